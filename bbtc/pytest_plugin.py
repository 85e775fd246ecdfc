"""The pytest plugin ``bbtc``: the trees of a project as tests.

With ``--bbtc``, or ``bbtc = true`` among pytest's settings, a manifest (``bbtc.yaml``, or a
``pyproject.toml`` with ``[tool.bbtc]``) that pytest comes across is collected. Each tree gives tests
``figures`` (the target and what is expected under ``expect``), ``files`` (the artefacts are what would be
written; ``--bbtc-update`` writes them) and, for each export that an engine here can run, one that it
behaves as simulated. The fixture ``bbtc_golden`` compares any artefact with a file.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from bbtc.builder.job import Made
    from bbtc.manifest.entries import Manifest, TreeEntry


def pytest_addoption(parser: pytest.Parser) -> None:
    """The plugin's options."""
    group = parser.getgroup("bbtc", "behavior trees from planning domains")
    group.addoption("--bbtc", action="store_true", help="collect the trees of bbtc's manifests as tests")
    group.addoption(
        "--bbtc-update",
        action="store_true",
        help="write artefacts that are missing or differ, instead of failing",
    )
    parser.addini("bbtc", "collect the trees of bbtc's manifests as tests", "bool", default=False)


def pytest_collect_file(file_path: Path, parent: pytest.Collector) -> pytest.Collector | None:
    """A manifest, if they are to be collected."""
    config = parent.config
    if file_path.name not in {"bbtc.yaml", "pyproject.toml"}:
        return None
    if not (config.getoption("--bbtc") or config.getini("bbtc")):
        return None
    from bbtc.manifest.find import is_manifest

    if not is_manifest(file_path):
        return None
    return ManifestFile.from_parent(parent, path=file_path)


class ManifestFile(pytest.File):
    """A manifest; its tests are those of its trees."""

    def collect(self) -> Iterator[pytest.Item | pytest.Collector]:
        """A collector for each tree. A manifest that is wrong is an error of collection."""
        from bbtc.diagnostics import BbtcError
        from bbtc.manifest.find import manifest_bytes
        from bbtc.manifest.read import read_manifest

        try:
            manifest = read_manifest(self.path, manifest_bytes(self.path))
        except BbtcError as error:
            raise self.CollectError(str(error)) from None
        for entry in manifest.trees:
            yield TreeTests.from_parent(self, name=entry.name, manifest=manifest, entry=entry)


class TreeTests(pytest.Collector):
    """The tests of one tree."""

    def __init__(self, *, manifest: Manifest, entry: TreeEntry, **options: object) -> None:
        super().__init__(**options)  # type: ignore[arg-type]
        self.manifest = manifest
        self.entry = entry
        self._made: Made | None = None

    def made(self) -> Made:
        """The tree, planned once, without its exports."""
        if self._made is None:
            from bbtc.builder.runner import make_tree

            self._made = make_tree(self.manifest, self.entry)
        return self._made

    def collect(self) -> Iterator[pytest.Item | pytest.Collector]:
        """The tests."""
        from bbtc.replay.equivalence import ENGINES

        yield TreeTest.from_parent(self, name="figures", check=self._figures)
        yield TreeTest.from_parent(self, name="files", check=self._files)
        for form in dict.fromkeys(e.form for e in self.entry.exports if e.form in ENGINES):
            yield TreeTest.from_parent(
                self, name=f"same-behaviour-{form}", check=lambda f=form: self._same(f)
            )

    def _figures(self) -> None:
        from bbtc.builder.runner import complaints

        made = self.made()
        _fail_with([*made.diagnostics, *complaints(self.entry, made)] if made.failure else [])

    def _files(self) -> None:
        from bbtc.builder.runner import build

        update = bool(self.config.getoption("--bbtc-update"))
        report = build(self.manifest.file, names=[self.entry.name], jobs=1, check=not update)
        _fail_with([d for outcome in report.outcomes if outcome.failure for d in outcome.diagnostics])

    def _same(self, form: str) -> None:
        from bbtc.artefacts import load_tree
        from bbtc.builder.job import TREE
        from bbtc.limits import Limits
        from bbtc.replay.equivalence import difference, engine_missing
        from bbtc.source import SourceFile

        missing = engine_missing(form)
        if missing is not None:
            pytest.skip(f"{missing}, which runs {form}, is not installed")
        made = self.made()
        if TREE not in made.steps:
            pytest.skip("there is no tree: see the test of its figures")
        ((name, data),) = made.steps[TREE].items()
        found = difference(load_tree(SourceFile(name, data.decode())), form, Limits())
        if found is not None:
            raise TreeFailure([found])


class TreeFailure(Exception):
    """What is wrong with a tree."""

    def __init__(self, messages: list[str]) -> None:
        super().__init__("\n".join(messages))


class TreeTest(pytest.Item):
    """One test of a tree."""

    def __init__(self, *, check: Callable[[], None], **options: object) -> None:
        super().__init__(**options)  # type: ignore[arg-type]
        self._check = check

    def runtest(self) -> None:
        """Run it."""
        self._check()

    def repr_failure(self, excinfo: pytest.ExceptionInfo[BaseException], style: object = None) -> str:
        """The diagnostics; of anything else, the traceback."""
        if isinstance(excinfo.value, TreeFailure):
            return str(excinfo.value)
        return str(super().repr_failure(excinfo, style))  # type: ignore[arg-type]

    def reportinfo(self) -> tuple[Path, int | None, str]:
        """Where the tree stands in the manifest."""
        assert isinstance(self.parent, TreeTests)
        span = self.parent.entry.span
        line = span.source.position(span.start)[0] - 1 if span is not None else None
        return self.path, line, f"{self.parent.name}: {self.name}"


def _fail_with(diagnostics: list[object]) -> None:
    from bbtc.diagnostics import Diagnostic

    if diagnostics:
        raise TreeFailure([d.render() for d in diagnostics if isinstance(d, Diagnostic)])


# --- for tests that people write themselves --------------------------------------------------


class Golden:
    """Compares artefacts with files under version control."""

    def __init__(self, update: bool) -> None:
        self.update = update

    def __call__(self, file: str | Path, content: str | bytes) -> None:
        """Fail, with a diff, unless the file has this content; with ``--bbtc-update``, write it."""
        from bbtc.diagnostics import BbtcError
        from bbtc.files.read_write import write

        path = Path(file)
        if self.update:
            path.parent.mkdir(parents=True, exist_ok=True)
        try:
            write(str(path), content, check=not self.update)
        except BbtcError as error:
            told = error.diagnostics[0].told
            pytest.fail(f"{told}\n(pytest --bbtc-update accepts it)", pytrace=False)


@pytest.fixture
def bbtc_golden(request: pytest.FixtureRequest) -> Golden:
    """Call it with a file and the text or bytes that it shall hold."""
    return Golden(bool(request.config.getoption("--bbtc-update")))
