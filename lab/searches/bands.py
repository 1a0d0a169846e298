"""Coverage of prediction bands, and inclusion probabilities of terms, on simulated records.

``python -m lab.searches.bands --seeds 10`` prints a line for every system and kind of noise: the fraction
of samples of new records inside the band of the best model, as mean, least and largest over the records. The
new records have new inputs and new noise and take no part in the identification. The records ``shifted`` have
an input of two fifths of the bandwidth, to which the level of the band does not refer. Those of ``beyond``
have an input of 1.35 times the amplitude, which leaves the range of the data.
"""

import argparse
from collections.abc import Callable
from dataclasses import dataclass
from time import perf_counter

import numpy as np
from numpy.typing import NDArray

import islands
from islands.models.narx import Model
from islands.models.regressor import regressor
from islands.systems.signals import filtered_noise

Signal = NDArray[np.float64]

#: Samples before a record, in which the system forgets its initial state.
SETTLING = 200

#: Samples of a test record.
TEST_SAMPLES = 800

#: Samples of a shooting interval.
SHOOTING = 100

#: Relative standard deviation of the noise.
LEVEL = 0.05

#: Pole of coloured noise.
POLE = 0.9

NOISES = ("equation", "output", "coloured")


@dataclass(frozen=True)
class Law:
    """A difference equation ``y(k) = step(y, u, k)`` and settings of its identification.

    Attributes
    ----------
    step : callable
    library, degree, lags : str and int
        Library of `islands.fit` and `islands.identify`.
    scale : float
        Scale of the output, for the noise.
    terms : tuple of str
        Terms of the law, if the library contains them.
    amplitude : float
        Scale of the input.
    equation_noise : float
        Factor of the noise in the equation, which the system may amplify.
    """

    step: Callable[[Signal, Signal, int], float]
    library: str
    degree: int
    lags: int
    scale: float
    terms: tuple[str, ...] = ()
    amplitude: float = 0.6
    equation_noise: float = 1.0


LAWS = {
    "bilinear": Law(
        lambda y, u, k: 0.6 * y[k - 1] + 0.3 * u[k - 1] + 0.2 * y[k - 1] * u[k - 1],
        "polynomial",
        2,
        2,
        0.5,
        ("y(k-1)", "u(k-1)", "y(k-1)*u(k-1)"),
    ),
    "duffing": Law(
        lambda y, u, k: 1.6 * y[k - 1] - 0.75 * y[k - 2] + 0.12 * u[k - 1] - 0.08 * y[k - 1] ** 3,
        "polynomial",
        3,
        2,
        0.8,
        ("y(k-1)", "y(k-2)", "u(k-1)", "y(k-1)*y(k-1)*y(k-1)"),
    ),
    "hysteresis": Law(
        lambda y, u, k: (
            y[k - 1]
            + 0.8 * (u[k - 1] - u[k - 2])
            - 0.5 * y[k - 1] * abs(u[k - 1] - u[k - 2])
            - 0.2 * abs(y[k - 1]) * (u[k - 1] - u[k - 2])
        ),
        "phi-polynomial",
        3,
        2,
        0.5,
    ),
    "tank": Law(
        lambda y, u, k: max(y[k - 1] + 0.1 * (1.2 + u[k - 1]) - 0.1 * np.sqrt(max(y[k - 1], 0.0)), 0.0),
        "polynomial",
        2,
        2,
        1.2,
        amplitude=0.2,
        equation_noise=0.3,
    ),
    "friction": Law(
        lambda y, u, k: 0.9 * y[k - 1] + 0.2 * u[k - 1] - 0.08 * np.tanh(y[k - 1] / 0.1),
        "polynomial",
        3,
        2,
        0.8,
    ),
    "drive": Law(
        lambda y, u, k: 1.55 * y[k - 1] - 0.65 * y[k - 2] + 0.1 * np.tanh(2.0 * u[k - 1]),
        "polynomial",
        3,
        2,
        0.6,
    ),
    "dead time": Law(
        lambda y, u, k: 0.8 * y[k - 1] + 0.3 * u[k - 5] - 0.1 * u[k - 5] ** 2,
        "polynomial",
        2,
        5,
        1.2,
        ("y(k-1)", "u(k-5)", "u(k-5)*u(k-5)"),
    ),
}


def simulate(law: Law, u: Signal, equation_error: Signal) -> Signal:
    """Return the output of a law from rest."""
    y = np.zeros(len(u))
    for k in range(law.lags, len(u)):
        y[k] = law.step(y, u, k) + equation_error[k]
    return y


def make_record(
    law: Law,
    noise: str,
    samples: int,
    rng: np.random.Generator,
    cutoff: float = 0.1,
    factor: float = 1.0,
) -> islands.Dataset:
    """Return a record with a new input, of a multiple of the amplitude, and new noise."""
    length = samples + SETTLING
    raw = filtered_noise(1.0, length, cutoff, int(rng.integers(2**31)))
    # The standard deviation of the filtered noise is the root of twice the cutoff.
    u = factor * law.amplitude * np.clip(raw / np.sqrt(2.0 * cutoff), -2.2, 2.2)
    white = LEVEL * law.scale * rng.standard_normal(length)
    y = simulate(law, u, law.equation_noise * white * (noise == "equation"))
    if noise == "output":
        y = y + white
    if noise == "coloured":
        coloured = np.zeros(length)
        for k in range(1, length):
            coloured[k] = POLE * coloured[k - 1] + np.sqrt(1.0 - POLE**2) * white[k]
        y = y + coloured
    return islands.Dataset(u[SETTLING:], y[SETTLING:], 1.0)


def identify(law: Law, record: islands.Dataset, method: str, seed: int) -> islands.Result:
    """Identify a record by forward selection or by a short evolution."""
    if method == "fit":
        return islands.fit(
            record, library=law.library, degree=law.degree, lags=law.lags, max_terms=8, shooting=SHOOTING
        )
    return islands.identify(
        record,
        preset="hysteresis" if law.library == "phi-polynomial" else "narx",
        seed=seed,
        population=60,
        generations=8,
        max_terms=8,
        shooting=SHOOTING,
        shifts=(1, 2),
        library_degree=law.degree,
        library_lags=law.lags,
    )


def coverage(model: islands.FittedModel, record: islands.Dataset, level: float) -> float:
    """Return the fraction of predicted samples inside the band."""
    band = model.bands(record, level)
    predicted = np.isfinite(band.y)
    inside = (band.lower <= record.y) & (record.y <= band.upper)
    return float(inside[predicted].mean())


def main() -> None:
    """Print the coverage by system and noise, and the inclusion probabilities by noise."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=10)
    parser.add_argument("--first-seed", type=int, default=0)
    parser.add_argument("--samples", type=int, default=1200, help="samples for estimation and validation")
    parser.add_argument("--records", type=int, default=3, help="test records per seed")
    parser.add_argument("--level", type=float, default=0.9)
    parser.add_argument("--method", choices=("fit", "identify"), default="fit")
    parser.add_argument("--system", action="append", choices=tuple(LAWS))
    arguments = parser.parse_args()
    titles = "   ".join(f"{each} mean, min, max" for each in ("coverage", "shifted", "beyond"))
    print(f"{'system':11s} {'noise':9s}  {titles}")
    cells, within, terms = [], [], {noise: ([], []) for noise in NOISES}
    began = perf_counter()
    for name in arguments.system or LAWS:
        law = LAWS[name]
        for noise in NOISES:
            tests, shifted, beyond = [], [], []
            for seed in range(arguments.first_seed, arguments.first_seed + arguments.seeds):
                rng = np.random.default_rng([seed, *map(ord, name + noise)])
                record = make_record(law, noise, arguments.samples, rng)
                best = identify(law, record, arguments.method, seed).best
                tests += [
                    coverage(best, make_record(law, noise, TEST_SAMPLES, rng), arguments.level)
                    for _ in range(arguments.records)
                ]
                new = make_record(law, noise, TEST_SAMPLES, rng, 0.04)
                shifted.append(coverage(best, new, arguments.level))
                new = make_record(law, noise, TEST_SAMPLES, rng, factor=1.35)
                beyond.append(coverage(best, new, arguments.level))
                ensemble = best.search_result.ensemble
                true = {regressor(islands.parse(text))[1] for text in law.terms}
                models = [each.model for each in ensemble.structures if isinstance(each.model, Model)]
                found = {item for model in models for item in model.regressors}
                if true:
                    terms[noise][0].extend(ensemble.inclusion(item.text) for item in true)
                    terms[noise][1].append(sum(ensemble.inclusion(item.text) for item in found - true))
            cells.append(np.mean(tests))
            within += [0.85 <= each <= 0.95 for each in tests]
            numbers = " ".join(
                f"{np.mean(each):8.3f} {min(each):6.3f} {max(each):6.3f}   "
                for each in (tests, shifted, beyond)
            )
            print(f"{name:11s} {noise:9s} {numbers}", flush=True)
    print(
        f"means within 0.85 to 0.95: {sum(0.85 <= each <= 0.95 for each in cells)} of {len(cells)}; "
        f"records within: {100 * np.mean(within):.0f} %; {perf_counter() - began:.0f} s"
    )
    for noise, (true, spurious) in terms.items():
        if true:
            print(
                f"{noise:9s} inclusion of true terms: mean {np.mean(true):.3f}, min {min(true):.3f}; "
                f"expected number of spurious terms: {np.mean(spurious):.2f}"
            )


if __name__ == "__main__":
    main()
