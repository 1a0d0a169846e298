"""Table of the benchmarks: descriptions, rules, origins, and published errors."""

from collections.abc import Mapping
from types import MappingProxyType

from islands.errors import lookup
from lab.published_sets import measured_files
from lab.published_sets.definition import Benchmark, PublishedError
from lab.published_sets.public_package import PACKAGE, make_package_benchmark

_BASELINES = "Champneys, Beintema, Toth, Schoukens and Rogers, arXiv 2405.10779"
_SITE = "nonlinearbenchmark.org"
_PACKAGE_RULE = "split and 50 initial samples of the package nonlinear_benchmarks 1.0.1"
_OWN_RULE = "split of this project, since the owners state none"


def _published(*entries: tuple[float, str, str]) -> tuple[PublishedError, ...]:
    return tuple(PublishedError(*entry) for entry in entries)


#: Sets whose files are in a folder of measured records, by name.
MEASURED: Mapping[str, Benchmark] = MappingProxyType(
    {
        "silverbox": Benchmark(
            description="Electronic oscillator with a stiffening spring.",
            published={
                "multisine": _published(
                    (0.301, "Gaussian-process NARX", _BASELINES),
                    (0.36, "best of earlier work", _BASELINES),
                    (0.640, "polynomial NARX", _BASELINES),
                    (6.96, "linear state space", _BASELINES),
                ),
                "arrow": _published(
                    (0.26, "best of earlier work", _BASELINES),
                    (0.60, "Gaussian-process NARX", _BASELINES),
                    (2.25, "polynomial NARX", _BASELINES),
                    (14.4, "linear state space", _BASELINES),
                ),
                "arrow-no-extrapolation": _published(
                    (0.259, "Gaussian-process NARX", _BASELINES),
                    (0.32, "best of earlier work", _BASELINES),
                    (0.571, "polynomial NARX", _BASELINES),
                    (6.58, "linear state space", _BASELINES),
                ),
            },
            unit="mV",
            scale=1e3,
            rule=_PACKAGE_RULE,
            address=f"Wigren and Schoukens, https://www.{_SITE}/benchmarks/silverbox",
            licence="MIT (of the copy)",
            read=measured_files.read_silverbox,
            files={"silverbox.npz": "a5f2636db4943265e07c1040fdcae24bc3cb7bc6170afc9d8c69e7dacdc9fecf"},
            samples=65_062,
            is_tuned=True,
        ),
        "cascaded-tanks": Benchmark(
            description="Two water tanks with overflow; the sensor of the lower one clips at 10 V.",
            published={
                "validation": _published(
                    (0.191, "grey box with overflow", _BASELINES),
                    (0.396, "gated recurrent unit", _BASELINES),
                    (0.413, "polynomial NARX", _BASELINES),
                    (0.588, "linear state space", _BASELINES),
                )
            },
            unit="V",
            scale=1.0,
            rule=_PACKAGE_RULE,
            address=f"Schoukens, Mattsson, Wigren and Noel, https://www.{_SITE}/benchmarks/cascaded-tanks",
            licence="MIT (of the copy)",
            read=measured_files.read_cascaded_tanks,
            files={"cascaded_tanks.csv": "78e9181e9ff95a763f18e0070fb8d64f6959d29c936aa04f535bc2fe37b72a60"},
            samples=1024,
            is_tuned=True,
        ),
        "wiener-hammerstein": Benchmark(
            description="Electronic circuit: filter, diode, filter.",
            published={
                "test": _published(
                    (0.241, "best of earlier work", _BASELINES),
                    (27.3, "polynomial NARX", _BASELINES),
                    (43.4, "linear state space", _BASELINES),
                )
            },
            unit="mV",
            scale=1e3,
            rule=_PACKAGE_RULE,
            address=f"Schoukens, Suykens and Ljung, https://www.{_SITE}/benchmarks/wiener-hammerstein",
            licence="MIT (of the copy)",
            read=measured_files.read_wiener_hammerstein,
            files={"wh2009.npz": "3e5f89a0f5b831c53968cec0b607b91cd68e510b09d6bb6d1baa41d518a786f4"},
            samples=100_000,
            is_tuned=True,
        ),
        "bouc-wen": Benchmark(
            description="Simulated oscillator with Bouc-Wen hysteresis.",
            published={
                "multisine": _published(
                    (
                        1.21,
                        "polynomial state space of degrees 3, 5 and 7 (217 parameters)",
                        "Noel, Fakhrizadeh Esfahani, Kerschen and Schoukens, arXiv 1610.09138",
                    ),
                    (4.52, "dynoNet", "Forgione and Piga, arXiv 2006.02250"),
                ),
                "sweep": (),
            },
            unit="1e-5 m",
            scale=1e5,
            rule="split of the owners without initial samples: 50 as for the other sets",
            address="Noel and Schoukens, doi 10.4121/12967592",
            licence="MIT (of the copy)",
            read=measured_files.read_bouc_wen,
            files={
                "boucwen_benchmark.npz": "29dce502d33aa62befabbc83a61f35cfb6ced947241e4c0054542572ca2b5b22"
            },
            samples=40_960,
            is_tuned=True,
        ),
        "fine-steering-mirror": Benchmark(
            description="Mirror on three piezo stacks: resonances and hysteresis; three inputs and outputs.",
            published={
                level: _published(
                    (value, "neural feedback, one model for all levels", f"https://www.{_SITE}")
                )
                for level, value in (("100mV", 0.0866), ("200mV", 0.131), ("300mV", 0.169))
            },
            unit="um",
            scale=1.0,
            rule="split of the owners; the second period of each test is scored, in the steady state",
            address=f"https://www.{_SITE}/benchmarks/fine-steering-mirror",
            licence="CC BY 4.0",
            read=measured_files.read_steering_mirror,
            files={"fsm_piezo.npz": "57adef8b8b66850320486eafcb0299b110ac1f2f61ad498f6d9a333045344ca5"},
            samples=294_912,
        ),
        "mr-damper": Benchmark(
            description="Magnetorheological damper at 0.87 V: displacement to force, a friction loop.",
            published={"test-6": (), "test-8": (), "test-10": ()},
            unit="N",
            scale=1.0,
            rule=f"{_OWN_RULE}: tests 6, 8 and 10 at this voltage are held out; 50 initial samples",
            address="doi 10.5281/zenodo.4445334",
            licence="MIT",
            read=measured_files.read_damper,
            files={
                "mrdamper_labcontrol.csv": "cb78cb8da8cc1280ebc01df7fec39e01cda42a447bcd4734e54ab00fe63cdcd3"
            },
            samples=10_507,
            is_tuned=True,
        ),
        "piezo-micromanipulator": Benchmark(
            description="Piezoelectric cantilever at 150 V and 1 Hz: hysteresis and creep.",
            published={"test": ()},
            unit="um",
            scale=1.0,
            rule=f"{_OWN_RULE}: the last quarter of the samples after 5 s; 50 initial samples",
            address="Data in Brief 29 (2020) 105175",
            licence="CC BY 4.0",
            read=measured_files.read_micromanipulator,
            files={
                "piezo_micromanipulator_150V_1Hz.csv": (
                    "01d6d35282c554fa396dd71f68c5123a191f236ac73fae96fe8ad4827be5f063"
                )
            },
            samples=18_750,
            is_tuned=True,
        ),
        "piezo-loops": Benchmark(
            description="Ferroelectric disc: butterfly loops of the strain at four amplitudes.",
            published={"1400V": ()},
            unit="nm",
            scale=1.0,
            rule=f"{_OWN_RULE}: the loop of 1400 V, between the others; 10 initial samples",
            address="University of Groningen",
            licence="not stated",
            read=measured_files.read_piezo_loops,
            files={
                "piezo_pnzt_loops.csv": "068507f0efee81209781e8bf140ab835ae750c0acbfc2fd0fc7d5a832911acf9"
            },
            samples=1203,
            is_tuned=True,
        ),
        "memory-alloy-wing": Benchmark(
            description="Wing with a shape-memory alloy: major and minor loops, nearly static.",
            published={"test": ()},
            unit="",
            scale=1.0,
            rule="split of the owners (DataT, DataE); 10 initial samples",
            address="not stated",
            licence="not stated",
            read=measured_files.read_memory_alloy,
            files={
                "sma_wing_hysteresis.csv": "a704ef44f50c8f0b63cb126fbcf97b8f855ed9041ea70bdf3a2b5816874fbcbd"
            },
            samples=642,
            is_tuned=True,
        ),
        "hair-dryer": Benchmark(
            description="Temperature of the air of a hair dryer: linear, with a dead time.",
            published={"test": ()},
            unit="degC",
            scale=1.0,
            rule=f"{_OWN_RULE}: the last quarter; 10 initial samples",
            address="DaISy, KU Leuven, set 96-006",
            licence="MIT (of the copy)",
            read=measured_files.read_hair_dryer,
            files={"daisy_hairdryer.csv": "3746b8debf6121a870db480403c181ed0999a1ddd708c7d011d5574b3b662634"},
            samples=750,
            is_tuned=True,
        ),
        "gas-furnace": Benchmark(
            description="Gas furnace of Box and Jenkins: linear, with a dead time and coloured noise.",
            published={"test": ()},
            unit="%",
            scale=1.0,
            rule=f"{_OWN_RULE}: the last quarter; 10 initial samples",
            address="Box, Jenkins and Reinsel, Time Series Analysis, series J",
            licence="Apache-2.0 (of the copy)",
            read=measured_files.read_gas_furnace,
            files={"gas_furnace.csv": "e6a9818fce67bfef8d756058ee8572c825dd51881c2327155a8efdb710ee41bf"},
            samples=222,
        ),
        "buck-converter": Benchmark(
            description="Voltage converter: two lags and a gain that depends on the operating point.",
            published={"validation": ()},
            unit="V",
            scale=1.0,
            rule="split of the owners; 50 initial samples",
            address="not stated with the copy",
            licence="MIT",
            read=measured_files.read_buck_converter,
            files={"buck_converter.csv": "2ee8c70b1c4b64a2a4c3e5838bd21eed9aad9587a5df8dd2cf97536a464782c4"},
            samples=1001,
            is_tuned=True,
        ),
    }
)


def find_benchmark(name: str) -> Benchmark:
    """Return a benchmark by name: an entry of the table, or ``nonlinear_benchmarks:EMPS``.

    Raises
    ------
    SettingsError
        There is no such benchmark, or the package is not installed.
    """
    package, colon, function = name.partition(":")
    if package == PACKAGE and colon:
        return make_package_benchmark(function)
    return lookup(MEASURED, name, "benchmark")
