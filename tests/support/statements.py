"""Checker of the sentences about a result: pairs of statements that exclude each other."""

import re
from collections.abc import Iterable, Mapping, Sequence
from importlib.resources import files
from typing import Any

from islands.sentences import write_named

#: Traces of a value that is missing or was not written for a reader.
EMPTY = re.compile(
    r"None|\bnan\b|\binf\b|Undefined|True|False|[{}\[\]]{2}|\(\)| [,.;:](\s|$)|[,;:][,.;]|\.\.|\(not computed"
)

#: Pairs of patterns that one text does not contain together.
EXCLUSIVE = (
    (r"As a simulation: good", r"Fails at: (?!none of the checks)"),
    (r"As a simulation: good", r"within the limits above"),
    (r"As a simulation: good", r"Good for: no use"),
    (r"As a simulation: (usable|unsuitable)", r"Fails at: none of the checks"),
    (r"As a simulation: unsuitable", r"Good for: [^.]*simulation from the inputs alone"),
    (r"As a simulation: (good|usable)", r"Fails at: [^:]*simulation from the inputs alone"),
    (
        r"Fails at: none of the checks",
        r"Next: [^.]*(allow more than|try (an estimate|terms|linear|products|even)|estimate from)",
    ),
    (r"no structure is left in the free-run residual", r"[%] of the free-run residual is predictable"),
    (r"no structure is left in the free-run residual", r"neither inputs nor past outputs predict it"),
    (r"As a simulation: good", r"(RMSE|,) ([3-9]\.\d|\d{2,}[.\d]*) times the (noise level|unpredictable)"),
    (r"the residual is a rounding error", r"[%] of the free-run residual is predictable"),
    (r"the free run on the validation data diverges", r"Good for: [^.]*simulation from the inputs alone"),
    (r"the free run on the validation data diverges", r"times that on the estimation data"),
    (r"As a simulation: good", r"(on|of) the estimation data (diverges|is [\d.e+]+ times)"),
    (r"every term has an inclusion probability", r"doubtful terms"),
    (r"every term has an inclusion probability", r"models without .* are about as good"),
    (r"As a simulation: unsuitable", r"models without .* are about as good"),
    (r"diverges in \d+ of \d+ holds", r"Physics: [^.]*(bounded|divergence) at inputs"),
    (r"diverges at (minor-loops|amplitude x|rate x)", r"Physics: [^.]*(bounded|divergence) at inputs"),
    (r"the data contradict the physics checks", r"Physics: .*(bounded|divergence) at inputs.* Fails at:"),
    (r"the data contradict the physics checks", r"(no model passes the physics checks|Fails at: none)"),
    (r"least free-run error on the validation data, RMSE", r"; left out: "),
    (r"no model passes the physics checks", r"Physics: .*(bounded|divergence) at inputs.* Fails at:"),
    (
        r"the output (diverges|leaves its recorded range) .*1\.2 of the rec",
        r"Physics: .*up to 1\.2 times.* Fails at:",
    ),
    (
        r"the output (diverges|leaves its recorded range) .*\(1 of the rec",
        r"Physics: .*up to 1(\.2)? times.* Fails at:",
    ),
    (r"the free run on the validation data diverges", r"(RMSE|,) \S+( times)? the noise level of"),
    (r"(RMSE|,) at the noise level of", r"simulation from the inputs alone: R2 [-.\d]+\d(?! ?of|[.\d])"),
    (r"the free run on the validation data diverges", r"As a simulation: (good|usable)"),
    (r"As a simulation: (good|usable)", r"Fails at: .*simulation from the inputs alone: the free run"),
    (r"Fails at: none of the checks", r"try other terms or more lags"),
    (r"Fails at: none of the checks", r"% of the free-run residual is predictable \(RMS"),
    (r"(no smaller model is as good|: smallest of \d+ models)", r"try [^;.]*smaller model"),
    (r"Good for: no use that", r"no structure is left in the"),
    (r"one step ahead, no structure is left", r"error one step ahead is \S+ times the noise level"),
    (r"No model found", r"(As a simulation: (good|usable)|Recommended: model|no structure is left in the)"),
    (r"No model found", r"Next: [^.]*(estimator=|islands simulate)"),
    (r"drifts by [\d.e+]+ % of its range at constant input", r"Physics: .*Property 1 holds.* Fails at:"),
)

#: A claimed cause that others together exceed in probability.
_UNLIKELY = (
    r"confidence (below )?0\.[0-4]\d(, [\d.]+ % of the misfit above the noise floor|"
    r"; without it, the RMSE is (not larger|much larger|[\d.e+]+ (times as large|% larger)))"
    r"(?!; improves|; this record does not distinguish [^;]*; improves)"
)

#: An error far above the noise.
_FAR = r"the RMSE is ([3-9](\.\d+)?|\d{2,}(\.\d+)?|\d[.\d]*e\+\d+) times the floor"

#: Effects that explain all of a discrepancy.
_WHOLE = r"explains? (the discrepancy|it)[.;]"

#: The same for the text about a diagnosis.
EXCLUSIVE_OF_DIAGNOSES = (
    (
        r"No significant discrepancy",
        r"(There is a (significant )?discrepancy|simulation (probably )?lacks|is (probably )?wrong, which)",
    ),
    (r"No significant discrepancy", r"the RMSE (falls|does not fall)"),
    (r"No significant discrepancy", r"(The remaining residual depends|none of which is confirmed)"),
    (
        r"No significant discrepancy",
        r"confidence (above |below )?\d\.\d\d(, [\d.]+ % of the (misfit|mean squared error)|; without it)",
    ),
    (r"No significant discrepancy: ", _FAR),
    (_WHOLE, _FAR),
    (_WHOLE, r"(The remaining residual depends|significant structure remains|none of which is confirmed)"),
    (
        r"explains? (most of |nearly all of |a part of )?(the discrepancy|it)[.;]",
        r"excluded from fitting, the RMSE does not fall significantly",
    ),
    (r"explains? [^.]*in the samples used for estimation", r"the RMSE falls from"),
    (r"the RMSE falls from", r"by -[\d.]+ %"),
    (r"the RMSE falls from [^%]*%", r"\((-[\d.]+ to|[\d.]+ to -)[^()]* with 95 % confidence\)"),
    (r"does not fall significantly", r"a reduction of [\d.]+ % \([\d.]*[1-9][\d.]* to"),
    (r"The simulation (probably )?lacks (a )?known effects?", _UNLIKELY),
    (r"is (probably )?wrong, which explains", _UNLIKELY),
    (r"(causes are|cause is) uncertain: (?!.*confidence (below )?0\.[0-4])", r""),
    (
        r"no known effect is confirmed",
        r"(confidence (above |below )?\d\.\d\d(, \d+ % of the misfit|; without it)|the RMSE falls)",
    ),
    (
        r"stopped before a verdict",
        r"(No significant discrepancy|explains? ([a-z]+ (all )?of )?(it|the discrepancy)|the RMSE falls)",
    ),
    (r"significant structure remains(?!.*(The remaining residual depends|A flexible model of))", r""),
    (
        r"Record and simulation do not match",
        r"(The simulation (probably )?lacks|No significant|the RMSE (falls|is))",
    ),
    (r"No significant discrepancy: .*the stated noise", r"The stated noise is"),
    (r"Known effects alone explain less", r"(the score is worse by -|that explain the record as well)"),
    (r"the RMSE is (below it|at the floor)", _FAR),
    (r"(is|,) a rounding error", r"the RMSE is [\d.e+]+ times the floor"),
    (_FAR, r"(What remains counts as coloured noise|The noise is large)"),
    (r"measured from repeated periods", r"(an upper bound|that repeats three times would)"),
    (r"Extended simulation: ", r"Calibrated with them: "),
    (r"no effect alone improves the fit", r"none of which is confirmed"),
)

#: Statements of one quantity, whose numbers are equal wherever they occur.
REPEATED = (
    r"(\d+) % of (?:the residual of the free run|the free-run residual) is predictable",
    r"RMSE (\S+) ?\S* of the free run on",
    r"(?:calibrated, with the effects |the RMSE falls from [^()]*\([^()]*\) to )([\d.e+-]+\d)",
    r"(?:the noise alone, is (?:at most )?|noise floor(?: \(upper bound\))? )([\d.]+(?:e[+-]\d+)?)",
)


def find_contradictions(text: str, outputs: Sequence[str] = ()) -> list[str]:
    """Return the contradictions of a text, whose lines and tags do not count.

    Of several outputs, the statements about the model and about one of them at a time do not contradict each
    other.
    """
    joined = " ".join(re.sub(r"<[^<>]*>", " ", text).split())
    if outputs:
        return [each for name in outputs for each in find_contradictions(_keep_output(joined, name, outputs))]
    found = [
        f"{one} / {other}"
        for one, other in (*EXCLUSIVE, *EXCLUSIVE_OF_DIAGNOSES)
        if re.search(one, joined) and re.search(other, joined)
    ]
    return found + [
        f"{pattern}: {values}" for pattern in REPEATED if len(values := set(re.findall(pattern, joined))) > 1
    ]


def _keep_output(text: str, name: str, outputs: Sequence[str]) -> str:
    """Return a text without the statements about other outputs than one."""
    named = "|".join(map(re.escape, outputs))
    statement = rf"\b((?:{named})(?: and (?:{named}))*)(?:, [a-z ]+: .*?\.(?=\s|$)|: .*?(?=; |\.\s|\.$))"
    return re.sub(statement, lambda found: found[0] if name in found[1].split(" and ") else "", text)


def check_template(template: str, cases: Mapping[str, Iterable[Mapping[str, Any]]]) -> None:
    """Assert that each statement of a template is written and complete in each of its cases."""
    source = (files("islands") / "templates" / f"{template}.txt").read_text(encoding="utf-8")
    assert set(re.findall(r"block (\w+)", source)) == set(cases)
    for name, variants in cases.items():
        for facts in variants:
            written = dict(write_named(template, name, **facts))
            assert name in written, name
            empty = {key: text for key, text in written.items() if EMPTY.search(text)}
            assert not empty, empty
