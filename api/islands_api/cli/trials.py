"""``islands trials``: effects are hidden in data by code of its own, and the analysis has to find them."""

import json
from dataclasses import asdict
from itertools import islice
from pathlib import Path
from typing import Annotated

import numpy as np
import typer
from rich.table import Table

from islands.errors import SettingsError
from islands.trials.hide.forms import KNOWN, UNKNOWN
from islands.trials.tally import Share, confusion, tally
from islands.trials.trial import Trial
from islands_api.cli.console import compile_kernels, output, progress
from islands_service.runtime.trials import side_by_side

#: Bands of the misfit of each effect in standard deviations of the noise: they are taken in turn.
BANDS = ((0.2, 1.0), (1.0, 4.0))

#: The pole of noise that remembers.
POLE = 0.9


def trials(
    effects: Annotated[
        list[str] | None, typer.Option("--effects", help="Names to hide, repeated; all by default.")
    ] = None,
    count: Annotated[int, typer.Option("--count", min=1, help="Trials of each effect.")] = 2,
    noise: Annotated[str, typer.Option("--noise", help="white or ar.")] = "white",
    clean: Annotated[int, typer.Option("--clean", min=0, help="Records with nothing hidden in them.")] = 20,
    pairs: Annotated[int, typer.Option("--pairs", min=0, help="Records with two effects.")] = 0,
    triples: Annotated[int, typer.Option("--triples", min=0, help="Records with three.")] = 0,
    open_set: Annotated[
        int,
        typer.Option("--open-set", min=0, help="Records of each cause that has no name in the catalogue."),
    ] = 2,
    variant: Annotated[
        bool, typer.Option("--variant", help="Hide in forms unlike those that the analysis extends by.")
    ] = False,
    seed: Annotated[int, typer.Option("--seed", min=0)] = 0,
    seconds: Annotated[float, typer.Option("--seconds", min=10.0, help="Length of a record.")] = 60.0,
    address: Annotated[str | None, typer.Option("--ray-address", help="HOST:PORT of a cluster.")] = None,
    out: Annotated[Path | None, typer.Option("--json", help="A file for the outcomes.")] = None,
) -> None:
    """Hide effects in simulated records, look for them, and count how often they are found and named."""
    names = _names(effects)
    if noise not in ("white", "ar"):
        raise SettingsError(f"--noise {noise}: take white or ar")
    pole = POLE if noise == "ar" else 0.0
    rng = np.random.default_rng(seed)
    asked = [
        Trial((name,), seed + turn, pole, BANDS[turn % len(BANDS)], variant, seconds)
        for name in names
        for turn in range(count)
    ]
    asked += [Trial((), seed + turn, pole, None, False, seconds) for turn in range(clean)]
    asked += [
        Trial((name,), seed + turn, pole, None, False, seconds)
        for name in UNKNOWN
        for turn in range(open_set)
    ]
    for size, many in ((2, pairs), (3, triples)):
        asked += [
            Trial(
                tuple(map(str, rng.choice(names, size, replace=False))),
                seed + turn,
                pole,
                BANDS[1],
                variant,
                seconds,
            )
            for turn in range(many)
        ]
    compile_kernels()
    with progress("trials") as tell:
        found = list(
            side_by_side(asked, address, lambda ended: tell(f"{ended} of {len(asked)}", ended / len(asked)))
        )
    shares = tally(found, list(UNKNOWN))
    output.print(_table(shares))
    wrong = {key: times for key, times in sorted(confusion(found).items()) if key[0] != key[1]}
    for (hidden, named), times in islice(wrong.items(), 40):
        output.print(f"{hidden or 'nothing'} was called {named or 'nothing'}: {times}", markup=False)
    if out is not None:
        document = {
            "shares": [{**asdict(share), "bounds": share.bounds} for share in shares],
            "outcomes": [asdict(each) for each in found],
        }
        out.write_text(json.dumps(document, indent=1))


def _names(effects: list[str] | None) -> list[str]:
    unknown = set(effects or ()) - set(KNOWN)
    if unknown:
        raise SettingsError(
            f"nobody knows how to hide {', '.join(sorted(unknown))}: take some of {', '.join(KNOWN)}"
        )
    return list(effects or KNOWN)


def _table(shares: list[Share]) -> Table:
    table = Table("", "trials", "percent", "95 %", "goal", "")
    for share in shares:
        if share.of:
            low, high = share.bounds
            goal = "" if share.goal is None else f"{'<=' if share.most else '>='} {share.goal:g}"
            kept = {True: "kept", False: "MISSED", None: ""}[share.kept]
            table.add_row(
                share.name, f"{share.of}", f"{share.percent:.1f}", f"{low:.1f} to {high:.1f}", goal, kept
            )
    return table
