"""The one registry of diagnostic codes and their titles.

Ranges: 00xx files and limits, 01xx syntax, 02xx names and types, 03xx checks (warnings),
04xx grounding, 05xx planning and trees, 06xx artefacts, 07xx exports.
"""

from __future__ import annotations

CODES: dict[str, str] = {
    # 00xx: files and limits
    "BBT0001": "file cannot be read",
    "BBT0002": "file is not text",
    "BBT0003": "file is empty",
    "BBT0004": "output cannot be written",
    "BBT0005": "input exceeds a limit",
    "BBT0006": "no domain, no problem, or more than one of them",
    "BBT0007": "a limit on time, states or nodes was reached",
    "BBT0008": "an artefact differs from what would be written",
    # 01xx: syntax
    "BBT0101": "syntax error",
    "BBT0110": "part given twice",
    "BBT0111": "part missing",
    "BBT0112": "division by zero",
    "BBT0113": "number too long",
    # 02xx: names and types
    "BBT0201": "unknown type",
    "BBT0202": "unknown predicate",
    "BBT0203": "unknown object",
    "BBT0204": "unknown parameter",
    "BBT0205": "unknown action or template",
    "BBT0206": "wrong number of arguments",
    "BBT0207": "argument of a wrong type",
    "BBT0208": "declared twice",
    "BBT0209": "cycle of types",
    "BBT0210": "number or probability out of range",
    "BBT0211": "probabilities sum above 1",
    "BBT0212": "construct not supported",
    "BBT0213": "problem without a goal",
    "BBT0214": "goal probability out of range",
    "BBT0215": "template calls itself",
    "BBT0216": "action in a child of a skipper that is not the last",
    "BBT0217": "problem is for another domain",
    "BBT0218": "nothing makes a three-valued predicate unknown",
    "BBT0219": "derived predicate is set",
    "BBT0220": "unknown function",
    "BBT0221": "section in the wrong definition",
    "BBT0222": "derived predicate depends on its own negation",
    "BBT0223": "initial fact with two values",
    "BBT0224": "foreach without a node around it",
    # 03xx: checks
    # 04xx: grounding
    "BBT0401": "too many ground actions or facts",
    "BBT0402": "grounding ran out of time or memory",
    "BBT0403": "too many initial states",
    "BBT0404": "oneof in the initial state",
    "BBT0405": "uncertain condition in the initial state",
    "BBT0406": "observation",
    "BBT0407": "sensor",
    "BBT0408": "recursive derived predicate",
    "BBT0409": "conditional cost or reward",
    "BBT0410": "number without a value",
    "BBT0411": "no goal to plan for",
    "BBT0412": "goal out of reach",
    "BBT0413": "goal already holds",
    # 05xx: planning
    "BBT0501": "unknown strategy",
    "BBT0502": "nothing left to insert before the target",
    # 06xx: artefacts, and the shape of trees
    "BBT0601": "artefact is not valid JSON",
    "BBT0602": "artefact of another format or version",
    "BBT0603": "field missing, unknown or repeated",
    "BBT0604": "field has a wrong value",
    "BBT0605": "nested too deeply",
    "BBT0606": "name of something that does not exist",
    "BBT0607": "name or id stands twice",
    "BBT0608": "probabilities do not sum to 1",
    "BBT0609": "tree without its task",
    "BBT0610": "action in a child of a Skipper that is not the last",
    "BBT0611": "control node without children",
    "BBT0612": "template calls itself",
    # 07xx: exports
    "BBT0701": "unknown export format",
    "BBT0702": "two exporters claim one format",
    "BBT0703": "exporter cannot be loaded",
    "BBT0704": "wrong export option",
    "BBT0705": "tree too deep for the engine",
}
