"""Has the process of :mod:`tests.cli.forked` run ``bbtc``, with the streams, the folder and the environment
of this one: a program that starts in no time, for scripts and build tools. It loads what is built into
Python, and nothing else unless a run ended by a signal."""

import posix
import sys
from _socket import AF_UNIX, SCM_RIGHTS, SHUT_WR, SOCK_STREAM, SOL_SOCKET, socket


def main() -> None:
    """Arguments: where the process listens, and those of ``bbtc``."""
    address, *arguments = sys.argv[1:]
    environment = {_text(name): _text(value) for name, value in posix.environ.items()}
    connection = socket(AF_UNIX, SOCK_STREAM)
    connection.connect(address)
    streams = b"".join(stream.to_bytes(4, sys.byteorder) for stream in (0, 1, 2))
    connection.sendmsg([b"."], [(SOL_SOCKET, SCM_RIGHTS, streams)])
    connection.sendall(ascii([posix.getcwd(), arguments, environment, None, None, False]).encode())
    connection.shutdown(SHUT_WR)
    told = b""
    while piece := connection.recv(100):
        told += piece
    status = int(told.split()[0])
    if status < 0:
        import signal

        signal.signal(-status, signal.SIG_DFL)
        posix.kill(posix.getpid(), -status)
    sys.exit(status)


def _text(name: bytes) -> str:
    return name.decode(errors="surrogateescape")


if __name__ == "__main__":
    main()
