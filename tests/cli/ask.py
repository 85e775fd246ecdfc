"""Has the process of :mod:`tests.cli.forked` run ``bbtc``, with the streams, the folder and the environment
of this one: a program that starts in no time, for scripts and build tools."""

from __future__ import annotations

import json
import os
import signal
import socket
import sys
from pathlib import Path


def main() -> None:
    """Arguments: where the process listens, and those of ``bbtc``."""
    address, *arguments = sys.argv[1:]
    request = [str(Path.cwd()), arguments, dict(os.environ), None, None, False]
    with socket.socket(socket.AF_UNIX) as connection:
        connection.connect(address)
        socket.send_fds(connection, [b"."], [0, 1, 2])
        connection.sendall(json.dumps(request).encode())
        connection.shutdown(socket.SHUT_WR)
        status, _ = json.loads(connection.makefile("rb").read())
    if status < 0:
        signal.signal(-status, signal.SIG_DFL)
        os.kill(os.getpid(), -status)
    sys.exit(status)


if __name__ == "__main__":
    main()
