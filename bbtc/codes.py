"""The one registry of diagnostic codes: what each means, how grave it is, and what a command ends with.

Ranges: 00xx files and limits, 01xx syntax, 02xx names and types, 03xx checks (warnings),
04xx grounding, 05xx planning and trees, 06xx artefacts, 07xx exports,
08xx verification, 10xx projects.
"""

from __future__ import annotations

import enum
from collections.abc import Iterable
from dataclasses import dataclass
from types import MappingProxyType

from bbtc.exit_status import ExitStatus


class Severity(enum.Enum):
    """How grave a diagnostic is; only errors stop a command."""

    ERROR = "error"
    WARNING = "warning"
    NOTE = "note"

    @property
    def rank(self) -> int:
        """From 0, the gravest, on."""
        return list(Severity).index(self)


_WARNING, _NOTE = Severity.WARNING, Severity.NOTE


@dataclass(frozen=True, slots=True)
class Code:
    """What all diagnostics of a code share. ``severity`` is that of most, and the gravest: what matters less
    in its place is told so. ``exit`` is what a command ends with where an error of the code stops it. A
    ``root_cause`` is told before everything else, much of which may follow from it."""

    code: str
    title: str
    severity: Severity = Severity.ERROR
    exit: ExitStatus = ExitStatus.ERRORS
    root_cause: bool = False

    @property
    def page(self) -> str:
        """The name of its page among those that :mod:`bbtc.pages` reads."""
        return f"{self.code}.md"

    def help_uri(self, site: str) -> str:
        """The address of its page on the documentation site (:func:`bbtc.pages.site`)."""
        return f"{site.rstrip('/')}/errors/{self.code}.html"


_CODES = (
    # 00xx: files and limits
    Code("BBT0001", "file cannot be read"),
    Code("BBT0002", "file is not text"),
    Code("BBT0003", "file is empty"),
    Code("BBT0004", "output cannot be written"),
    Code("BBT0005", "input exceeds a limit"),
    Code("BBT0006", "no domain, no problem, or more than one of them"),
    Code("BBT0007", "a limit on time, states or nodes was reached", exit=ExitStatus.LIMIT),
    Code("BBT0008", "an artefact differs from what would be written"),
    Code("BBT0009", "output in the place of something else", exit=ExitStatus.USAGE),
    Code("BBT0010", "name that a depfile cannot hold"),
    # 01xx: syntax
    Code("BBT0101", "syntax error"),
    Code("BBT0102", "parenthesis never closed"),
    Code("BBT0103", "closing parenthesis too many"),
    Code("BBT0104", "character that the language does not use"),
    Code("BBT0110", "part given twice"),
    Code("BBT0111", "part missing"),
    Code("BBT0112", "division by zero"),
    Code("BBT0113", "number too long"),
    # 02xx: names and types
    Code("BBT0201", "unknown type"),
    Code("BBT0202", "unknown predicate"),
    Code("BBT0203", "unknown object"),
    Code("BBT0204", "unknown parameter"),
    Code("BBT0205", "unknown action or template"),
    Code("BBT0206", "wrong number of arguments"),
    Code("BBT0207", "argument of a wrong type"),
    Code("BBT0208", "declared twice"),
    Code("BBT0209", "cycle of types"),
    Code("BBT0210", "probability out of range"),
    Code("BBT0211", "probabilities sum above 1"),
    Code("BBT0212", "construct not supported"),
    Code("BBT0213", "problem without a goal"),
    Code("BBT0214", "goal probability out of range"),
    Code("BBT0215", "template calls itself"),
    Code("BBT0216", "action in a child of a skipper that is not the last"),
    Code("BBT0217", "problem is for another domain", _WARNING),
    Code("BBT0218", "nothing makes a three-valued predicate unknown", _WARNING),
    Code("BBT0219", "derived predicate is set"),
    Code("BBT0220", "unknown function"),
    Code("BBT0221", "section in the wrong definition"),
    Code("BBT0222", "derived predicate depends on its own negation"),
    Code("BBT0223", "initial fact with two values"),
    Code("BBT0224", "foreach without a node around it"),
    Code("BBT0225", "name that is not declared", _WARNING),
    Code("BBT0226", "section given twice", _WARNING),
    Code("BBT0227", "predicate with the name of a test", _NOTE),
    Code("BBT0228", "name with a meaning of its own"),
    Code("BBT0229", "derived predicate is external"),
    Code("BBT0230", "name that only a lenient reading takes", _WARNING),
    Code("BBT0231", "event whose order or rate makes no sense"),
    Code("BBT0232", "effect of an abort that nothing causes"),
    # 03xx: checks
    Code("BBT0301", "unused predicate", _WARNING),
    Code("BBT0302", "unreachable action", _WARNING),
    Code("BBT0303", "contradicting effects", _WARNING),
    Code("BBT0304", "condition that nothing makes true or known", _WARNING),
    Code("BBT0305", "duplicate actions", _WARNING),
    Code("BBT0306", "action without effect", _WARNING),
    Code("BBT0307", "action that cannot matter", _WARNING),
    Code("BBT0308", "doubtful probability", _WARNING),
    Code("BBT0309", "unused parameter", _WARNING),
    Code("BBT0310", "unused template", _WARNING),
    Code("BBT0311", "requirements that do not match the content", _WARNING),
    Code("BBT0313", "condition that only others can make true", _NOTE),
    Code("BBT0315", "fact that nothing makes unknown", _WARNING, root_cause=True),
    Code("BBT0316", "goal that nothing can make true", _WARNING, root_cause=True),
    Code("BBT0317", "condition that only events change", _NOTE),
    # 04xx: grounding
    Code("BBT0403", "too many initial states"),
    Code("BBT0404", "oneof in the initial state"),
    Code("BBT0405", "uncertain condition in the initial state"),
    Code("BBT0406", "observation"),
    Code("BBT0407", "sensor"),
    Code("BBT0408", "recursive derived predicate"),
    Code("BBT0410", "number without a value"),
    Code("BBT0411", "no goal to plan for"),
    Code("BBT0412", "goal out of reach", root_cause=True),
    Code("BBT0413", "goal already holds", _WARNING),
    Code("BBT0414", "no world is left"),
    Code("BBT0415", "too many worlds"),
    Code("BBT0416", "condition that mixes too much"),
    Code("BBT0417", "observation that tells nothing", _WARNING),
    Code("BBT0418", "choice without branches"),
    Code("BBT0419", "repeats without noise", _WARNING),
    Code("BBT0420", "belief that cannot be asked for"),
    Code("BBT0421", "model of observation that is not read"),
    Code("BBT0430", "too much for the text of a partially observable process"),
    Code("BBT0431", "true world that cannot be", _WARNING),
    Code("BBT0432", "reading that tells nothing, or the contrary"),
    Code("BBT0433", "file that does not hold what an action may set", _WARNING),
    Code("BBT0437", "range of a number"),
    Code("BBT0438", "number without a bound"),
    Code("BBT0439", "number outside its range at the start"),
    Code("BBT0440", "use of numbers that cannot be told apart"),
    Code("BBT0441", "numbers where they are not supported"),
    Code("BBT0442", "comparison that can never hold", _WARNING),
    Code("BBT0443", "duration that cannot be"),
    Code("BBT0444", "time-out that cannot be"),
    Code("BBT0445", "time-out beside hidden facts"),
    Code("BBT0446", "time that is not known"),
    Code("BBT0447", "deadline that no run can meet"),
    Code("BBT0448", "body that tries again for ever"),
    Code("BBT0449", "durative action that takes concurrency"),
    Code("BBT0450", "time limit on a part of a body"),
    Code("BBT0451", "events that contradict each other"),
    Code("BBT0452", "event that cannot be grounded yet"),
    # 05xx: planning
    Code("BBT0501", "unknown strategy", exit=ExitStatus.USAGE),
    Code("BBT0502", "nothing left to insert before the target", _WARNING),
    Code("BBT0503", "option that the strategy does not know", exit=ExitStatus.USAGE),
    Code("BBT0504", "a tree would have more levels than one may have", exit=ExitStatus.LIMIT),
    Code("BBT0505", "strategy that does not plan with hidden facts", exit=ExitStatus.USAGE),
    Code("BBT0506", "hidden facts where they cannot be taken into account"),
    # 06xx: artefacts, and the shape of trees
    Code("BBT0601", "artefact is not valid JSON"),
    Code("BBT0602", "artefact of another format or version"),
    Code("BBT0603", "field missing, unknown or repeated"),
    Code("BBT0604", "field has a wrong value"),
    Code("BBT0605", "nested too deeply"),
    Code("BBT0606", "name of something that does not exist"),
    Code("BBT0607", "name or id stands twice"),
    Code("BBT0608", "probabilities do not sum to 1"),
    Code("BBT0609", "tree without its task"),
    Code("BBT0610", "action in a child of a Skipper that is not the last"),
    Code("BBT0611", "control node without children"),
    Code("BBT0612", "template calls itself"),
    Code("BBT0613", "wrong number of attempts"),
    Code("BBT0614", "XML that is not well-formed, or has a document type"),
    Code("BBT0615", "not a BehaviorTree.CPP file"),
    Code("BBT0616", "node that a tree has no counterpart for"),
    Code("BBT0617", "notes that cannot be read", _WARNING),
    Code("BBT0618", "BehaviorTrees that nobody calls", _NOTE),
    Code("BBT0619", "which BehaviorTree to read is not clear"),
    Code("BBT0620", "file that ticks without end where the tree fails", _WARNING),
    # 07xx: exports
    Code("BBT0701", "unknown export format", exit=ExitStatus.USAGE),
    Code("BBT0702", "two exporters claim one format"),
    Code("BBT0703", "exporter that does not load, or fails"),
    Code("BBT0704", "wrong export option", exit=ExitStatus.USAGE),
    Code("BBT0705", "tree too deep for the engine"),
    Code("BBT0706", "no program can draw the picture"),
    Code("BBT0707", "module that Python cannot import"),
    Code("BBT0708", "binding of what the domain or a table does not have"),
    Code("BBT0709", "models of nodes that cannot be read"),
    Code("BBT0710", "bound node without model, or of another kind"),
    Code("BBT0711", "port that a bound node lacks or needs"),
    Code("BBT0712", "value that a port does not take"),
    Code("BBT0713", "binding that the export cannot keep"),
    # 08xx: verification
    Code("BBT0801", "tree whose figures are not what it claims"),
    Code("BBT0802", "tree that is not sound"),
    Code("BBT0803", "Storm is not installed"),
    Code("BBT0804", "Storm gave no answer"),
    # 10xx: projects
    Code("BBT1001", "manifest is not valid YAML or TOML"),
    Code("BBT1002", "no manifest, or two"),
    Code("BBT1003", "two artefacts in one file"),
    Code("BBT1004", "target not reached in a build"),
    Code("BBT1005", "expected figure not met"),
    Code("BBT1006", "internal error in a build", exit=ExitStatus.INTERNAL),
    Code("BBT1007", "file in the way of a new project"),
    Code("BBT1008", "link in the way of a build"),
    Code("BBT1009", "artefact in the place of a source"),
    Code("BBT1011", "file that is yours is left as it is", _NOTE),
    Code("BBT1012", "file that is yours does not fit the tree", _WARNING),
)

CODES = MappingProxyType({each.code: each for each in _CODES})
"""Every code, in order."""

_GRAVEST_FIRST = (ExitStatus.INTERNAL, ExitStatus.ERRORS, ExitStatus.LIMIT, ExitStatus.USAGE)


def exit_status(codes: Iterable[str]) -> ExitStatus:
    """What a command ends with that errors of these codes stop: a limit, or wrong usage, only where nothing
    else is wrong."""
    found = {CODES[code].exit for code in codes}
    return next((status for status in _GRAVEST_FIRST if status in found), ExitStatus.DONE)
