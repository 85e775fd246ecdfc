"""Building a project: find what is out of date, make it, write it.

Nothing heavy is imported as long as nothing is out of date.
"""

from __future__ import annotations

import contextlib
import time
from collections.abc import Callable, Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeAlias

from bbtc.builder.state import (
    Contents,
    Held,
    Step,
    Steps,
    cannot_build,
    load_state,
    plugin_version,
    settings_digest,
    sole_builder,
    tool_version,
)
from bbtc.diagnostics import BbtcError, Diagnostic
from bbtc.files.folder import Batch
from bbtc.files.read_write import SameFiles, reason, relative_parts, write
from bbtc.manifest.find import manifest_bytes, source_name

if TYPE_CHECKING:
    from bbtc.builder.job import Failure, Job, Made
    from bbtc.manifest.entries import Manifest, TreeEntry

_SAVE_EVERY = 1.0
"""Seconds between two savings of the state, which bound what a kill can lose."""

BuildStatus: TypeAlias = Literal["unchanged", "built", "failed"]


@dataclass(frozen=True, slots=True)
class Outcome:
    """What became of a tree. ``unchanged``: nothing was out of date. ``built``: something was; ``changed``
    are the files that differ from before. ``failed``: none of its files was touched (under ``check``:
    or a file differs from what would be written); ``failure`` tells how. ``summary`` has its
    figures, if it was built."""

    name: str
    status: BuildStatus
    changed: tuple[str, ...] = ()
    diagnostics: tuple[Diagnostic, ...] = ()
    failure: Failure | None = None
    summary: str | None = None


@dataclass(frozen=True, slots=True)
class BuildReport:
    """The outcome of every tree, in the order of the manifest."""

    outcomes: tuple[Outcome, ...]

    def count(self, status: BuildStatus) -> int:
        """How many trees had this outcome."""
        return sum(outcome.status == status for outcome in self.outcomes)

    @property
    def ok(self) -> bool:
        """Did everything succeed?"""
        return not self.count("failed")


Tell: TypeAlias = Callable[[int, int, str], None]
"""Is told how many of how many trees are done, and the name of the last one."""


def build(
    manifest: Path,
    *,
    names: Sequence[str] = (),
    jobs: int | None = None,
    check: bool = False,
    force: bool = False,
    tell: Tell | None = None,
) -> BuildReport:
    """Build the trees of a manifest, or only those named; with ``check``, write nothing, and let a tree fail
    if a file of it differs from what would be written. ``force`` builds what is up to date, too;
    ``jobs`` are done at once (default: one for each processor).

    Raises :class:`BbtcError` for a manifest that is wrong and an unknown name; whatever is wrong with one
    tree is part of its outcome. ``KeyboardInterrupt`` leaves what was built until then.
    """
    manifest = manifest.absolute()
    with contextlib.ExitStack() as stack:
        held = None if check else stack.enter_context(sole_builder(manifest.parent))
        return _Builder(manifest, jobs, held, tell or (lambda *_: None)).run(names, force)


class _Builder:
    """One build; nothing is written unless its folder is held."""

    def __init__(self, file: Path, jobs: int | None, held: Held | None, tell: Tell) -> None:
        self.file = file
        self.folder = file.parent
        self.jobs = jobs
        self.held = held
        self.tell = tell
        self.contents = Contents(self.folder)
        self.state = load_state(self.folder)
        self.plans: dict[str, Steps] = {}
        self.fresh: dict[str, Steps] = {}
        self.saved = time.monotonic()

    def run(self, names: Sequence[str], force: bool) -> BuildReport:
        """Build."""
        data = manifest_bytes(self.file)
        versions = {"bbtc": tool_version()}
        versions |= {form: plugin_version(form) for form in self.state.versions if form != "bbtc"}
        manifest_digest = self.contents.wrote(self.file.name, data)
        known = self.state.manifest == manifest_digest and self.state.versions == versions
        if known and not force:
            stale = [name for name, steps in self.state.trees.items() if not self._fresh(steps)]
            wanted = [name for name in names or stale if name in stale or name not in self.state.trees]
            if not wanted:
                return BuildReport(tuple(Outcome(name, "unchanged") for name in names or self.state.trees))
        return self._build(data, manifest_digest, versions, names, force)

    def _fresh(self, steps: Steps) -> bool:
        return bool(steps) and all(self.contents.fresh(step) for step in steps.values())

    def _build(
        self,
        data: bytes,
        manifest_digest: str,
        versions: Mapping[str, str],
        names: Sequence[str],
        force: bool,
    ) -> BuildReport:
        from bbtc.builder.pool import do_all, processors
        from bbtc.manifest.read import read_manifest

        manifest = read_manifest(self.file, data, source_name(self.folder, self.file.name))
        forms = sorted({export.form for entry in manifest.trees for export in entry.exports})
        plugins = {form: version for form in forms if (version := plugin_version(form))}
        self.state.versions = {"bbtc": versions["bbtc"], **plugins}
        self.state.manifest = manifest_digest
        self.state.trees = {entry.name: self.state.trees.get(entry.name, {}) for entry in manifest.trees}
        entries = {entry.name: entry for entry in _chosen(manifest, names)}
        _require_apart(manifest)
        outcomes: dict[str, Outcome] = {}
        jobs: list[Job] = []
        for entry in manifest.trees:
            self.plans[entry.name] = plan = self._steps(entry)
            stale = self._stale(entry, plan, force and entry.name in entries)
            if entry.name in entries and not stale:
                outcomes[entry.name] = Outcome(entry.name, "unchanged")
            elif entry.name in entries:
                try:
                    jobs.append(self._job(entry, stale))
                except BbtcError as error:
                    outcomes[entry.name] = Outcome(entry.name, "failed", (), error.diagnostics, "error")
        try:
            for made in do_all(jobs, self.jobs or processors()):
                entry = entries[made.name]
                outcomes[made.name] = self._settle(entry, made)
                self.tell(len(outcomes), len(entries), made.name)
                self._save(now=False)
        finally:
            self._save(now=True)
        return BuildReport(tuple(outcomes[name] for name in entries))

    # --- what is out of date -----------------------------------------------------------------

    def _steps(self, entry: TreeEntry) -> Steps:
        """The steps of a tree with the digests of their settings; what they read and write is known when
        they are done."""
        from bbtc.builder.job import FIGURES, TREE, export_step

        versions = self.state.versions
        tool = versions["bbtc"]
        options = (entry.strategy, entry.max_actions, entry.retries, entry.prefer, entry.closed_world)
        reading = (entry.reading.problem, entry.reading.lenient)
        planned = (entry.inputs, reading, entry.target, options, entry.limits)
        steps = {TREE: Step(settings_digest(tool, planned, entry.file), {}, {})}
        if entry.expect:
            expected = [expectation.text for expectation in entry.expect]
            rate = () if entry.perturb is None else (entry.perturb,)
            steps[FIGURES] = Step(settings_digest(tool, expected, *rate), {}, {})
        for export in entry.exports:
            how = (export.form, versions.get(export.form), export.file, export.options)
            steps[export_step(export.name)] = Step(settings_digest(tool, how), {}, {})
        return steps

    def _stale(self, entry: TreeEntry, plan: Steps, force: bool) -> set[str]:
        """The steps of a tree that have to be done. Only those that have not are left in the state, and none
        of a tree that is not complete, until it is."""
        done = self.state.trees[entry.name]
        fresh = {
            name: done[name]
            for name, step in plan.items()
            if name in done
            and not force
            and done[name].settings == step.settings
            and self.contents.fresh(done[name])
        }
        complete = fresh.keys() == plan.keys()
        self.fresh[entry.name] = fresh
        self.state.trees[entry.name] = fresh if complete else {}
        return plan.keys() - fresh.keys()

    def _job(self, entry: TreeEntry, stale: set[str]) -> Job:
        """What has to be done for a tree. Raises :class:`BbtcError` for an input that cannot be read, and for
        a place that cannot be written to."""
        from bbtc.backends.registry import with_paths
        from bbtc.builder.job import FIGURES, TREE, Job, export_step

        if self.held is not None:
            _require_places(self.held, entry)
        tree = None
        if TREE not in stale:
            with contextlib.suppress(OSError):
                tree = self.contents.read(entry.file)
        every = tree is None  # a new tree makes everything anew
        exports = tuple(
            replace(each, options=with_paths(each.form, each.options, partial(source_name, self.folder)))
            for each in entry.exports
            if every or export_step(each.name) in stale
        )
        figures = bool(entry.expect) and (every or FIGURES in stale)
        read = every or (figures and any(expectation.disturbed for expectation in entry.expect))
        sources = _sources(self.contents, entry) if read else ()
        return Job(_without_places(entry), sources, tree, figures, exports)

    # --- what was made -----------------------------------------------------------------------

    def _settle(self, entry: TreeEntry, made: Made) -> Outcome:
        """Write what was made, take note of it, and tell what became of the tree."""
        from bbtc.builder.job import TREE, export_step

        diagnostics = [*made.diagnostics, *complaints(entry, made)]
        if made.failure is not None:
            return Outcome(entry.name, "failed", (), tuple(diagnostics), made.failure)
        everything = {path: data for files in made.steps.values() for path, data in files.items()}
        changed: list[str] = []
        try:
            wanted = self._wanted(everything, made.begun, diagnostics)
            changed = self._compare(wanted) if self.held is None else self._write(self.held, wanted)
        except BbtcError as error:
            return Outcome(entry.name, "failed", (), (*diagnostics, *error.diagnostics), "error")
        done = self.fresh[entry.name]
        reads = {export_step(export.name): export.reads for export in entry.exports}
        for name, files in made.steps.items():
            inputs = entry.inputs if name == TREE else (entry.file, *reads.get(name, ()))
            known = {path: self.contents.digest(path) or "" for path in inputs}
            outputs = {
                path: (path in made.begun and self.contents.digest(path)) or self.contents.wrote(path, data)
                for path, data in files.items()
            }
            done[name] = replace(self.plans[entry.name][name], inputs=known, outputs=outputs)
        self.state.trees[entry.name] = done
        return Outcome(entry.name, "built", tuple(changed), tuple(diagnostics), summary=made.summary)

    def _wanted(
        self, files: Mapping[str, bytes], begun: Collection[str], diagnostics: list[Diagnostic]
    ) -> dict[str, bytes]:
        """What is to be written where: a text that begins a file does not go over one that somebody has
        filled in. Warnings go to ``diagnostics``; raises :class:`BbtcError` for what cannot be read."""
        from bbtc.backends.begun import place_of

        found = {}
        for path, data in files.items():
            if path not in begun:
                found[path] = data
                continue
            shown = source_name(self.folder, path)
            try:
                old = self.contents.read(path)
            except FileNotFoundError:
                old = None
            except OSError as error:
                raise BbtcError.single("BBT0004", f"cannot read {shown}: {reason(error)}") from error
            place = place_of(path, old, data, shown=shown, check=self.held is None)
            diagnostics.extend([place.warning] if place.warning is not None else [])
            if place.path is not None:
                found[place.path] = data
        return found

    def _compare(self, files: Mapping[str, bytes]) -> list[str]:
        """Raise :class:`BbtcError` with every difference between files and what would be written."""
        found: list[Diagnostic] = []
        for path, data in files.items():
            try:
                write(source_name(self.folder, path), data, check=True)
            except BbtcError as error:
                found.extend(error.diagnostics)
        if found:
            raise BbtcError(found)
        return []

    def _write(self, held: Held, files: Mapping[str, bytes]) -> list[str]:
        """Write the files of a tree, all or none; those that changed. Raises :class:`BbtcError`."""
        changed = []
        with Batch(held.scratch) as batch:
            path = ""
            try:
                for path, data in files.items():
                    *above, name = relative_parts(path)
                    folder = batch.below(held.project, tuple(above))
                    if folder.status(name) is None or folder.read(name, len(data) + 1) != data:
                        batch.put(folder, name, data)
                        changed.append(path)
                path = ", ".join(changed)
                batch.commit()
            except OSError as error:
                raise cannot_build(source_name(self.folder, path), error) from error
        return changed

    def _save(self, *, now: bool) -> None:
        if self.held is None or (not now and time.monotonic() - self.saved < _SAVE_EVERY):
            return
        self.held.save(self.state)
        self.saved = time.monotonic()


def _require_apart(manifest: Manifest) -> None:
    """Raise :class:`BbtcError` where something that is to be made is, by another name, the manifest or an
    input of a tree. (What has the same name is told when the manifest is read.)"""
    sources = SameFiles()
    for path in (manifest.file.name, *(path for entry in manifest.trees for path in entry.reads)):
        sources.note(str(manifest.folder / path), path)
    found = []
    for entry in manifest.trees:
        for file, span in ((entry.file, entry.span), *((e.file, e.span) for e in entry.exports)):
            source = sources.find(str(manifest.folder / file))
            if source is not None:
                found.append(Diagnostic("BBT1009", f"{file} is the source {source} by another name", span))
    if found:
        raise BbtcError(found)


def _require_places(held: Held, entry: TreeEntry) -> None:
    places = [(entry.file, False, entry.span), *((e.file, e.many, e.span) for e in entry.exports)]
    for file, many, span in places:
        try:
            held.project.require_place(relative_parts(file), for_folder=many)
        except OSError as error:
            raise cannot_build(source_name(held.path, file), error, span) from error


def sources_of(manifest: Path) -> list[Path]:
    """The files that a build depends on: the manifest, and, if it can be read, the inputs of its trees."""
    from bbtc.manifest.read import read_manifest

    file = manifest.absolute()
    files = {file}
    with contextlib.suppress(BbtcError):
        for entry in read_manifest(file, manifest_bytes(file)).trees:
            files.update(file.parent / path for path in entry.reads)
    return sorted(files)


def make_tree(manifest: Manifest, entry: TreeEntry) -> Made:
    """Plan a tree and look at its figures, without exports and without looking at what was built before.
    Raises :class:`BbtcError` for an input that cannot be read."""
    from bbtc.builder.job import Job, perform

    sources = _sources(Contents(manifest.folder), entry)
    return perform(Job(_without_places(entry), sources, None, bool(entry.expect), ()))


def _sources(contents: Contents, entry: TreeEntry) -> tuple[tuple[str, bytes], ...]:
    """The inputs of a tree, with the names that messages give them. Raises :class:`BbtcError`."""
    sources = []
    for number, path in enumerate(entry.inputs):
        shown = source_name(contents.folder, path)
        try:
            sources.append((shown, contents.source(path)))
        except (OSError, ValueError) as error:
            span = entry.input_spans[number] if entry.input_spans else entry.span
            raise BbtcError.single("BBT0001", f"cannot read {shown}: {reason(error)}", span) from error
    return tuple(sources)


def _chosen(manifest: Manifest, names: Sequence[str]) -> Iterable[TreeEntry]:
    """The entries of these names, or all. Raises :class:`BbtcError` for a name that there is not."""
    from bbtc.artefacts.cursor import clip, nearest

    known = [entry.name for entry in manifest.trees]
    for name in names:
        if name not in known:
            hint = nearest(name, known) or f"there are {', '.join(known[:10]) or 'none'}"
            raise BbtcError.single("BBT0606", f"the manifest has no tree '{clip(name)}'", hint=hint)
    return [entry for entry in manifest.trees if not names or entry.name in names]


def _without_places(entry: TreeEntry) -> TreeEntry:
    """The entry without the text of the manifest, which is not sent to other processes."""
    return replace(
        entry,
        span=None,
        input_spans=(),
        exports=tuple(replace(export, span=None) for export in entry.exports),
        expect=tuple(replace(expectation, span=None) for expectation in entry.expect),
    )


def complaints(entry: TreeEntry, made: Made) -> Iterator[Diagnostic]:
    """What the manifest asks for and the tree does not give, with the places in the manifest."""
    if made.short is not None:
        hint = f"`bbtc plan {' '.join(entry.inputs)}` shows how far it gets, and why no further"
        yield Diagnostic("BBT1004", f"{entry.name}: {made.short}", entry.span, hint)
    for number, found in made.unmet:
        expected = entry.expect[number]
        message = f"{entry.name}: expected {expected.text}, but {found}"
        yield Diagnostic("BBT1005", message, expected.span)
