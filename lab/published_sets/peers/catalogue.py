"""Table of the peers: package, version, script and setting."""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from types import MappingProxyType

_SCRIPTS = Path(__file__).parent / "scripts"


@dataclass(frozen=True, slots=True)
class Peer:
    """Another package for the identification of systems.

    Attributes
    ----------
    package : str
        Name in the package index.
    version : str
    script : Path
        File with the functions that the child process calls.
    setting : str
        How it is used, in a sentence.
    reads_several_outputs : bool
        Whether a model has all outputs of a record with several.
    """

    package: str
    version: str
    script: Path
    setting: str
    reads_several_outputs: bool = True


#: Peers by the name of the command line.
PEERS: Mapping[str, Peer] = MappingProxyType(
    {
        "sysidentpy": Peer(
            "sysidentpy",
            "0.9.0",
            _SCRIPTS / "sysidentpy_frols.py",
            "Polynomial NARX by FROLS with at most 30 terms by BIC; degree 2 or 3 and 2 to 20 lags by the "
            "held-out quarter.",
            reads_several_outputs=False,
        ),
        "pysindy": Peer(
            "pysindy",
            "2.1.0",
            _SCRIPTS / "pysindy_sindyc.py",
            "SINDYc in discrete time with lagged outputs as states; STLSQ, degree 1 to 3, 2 to 10 lags "
            "and the threshold by the held-out quarter.",
        ),
        "jax-sysid": Peer(
            "jax-sysid",
            "1.1.0",
            _SCRIPTS / "jax_sysid_rnn.py",
            "State space with a linear part and networks of 8 neurons in both equations; Adam, then L-BFGS; "
            "2 to 8 states and one of three seeds by the held-out quarter.",
        ),
        "fastcan": Peer(
            "fastcan",
            "0.6.0",
            _SCRIPTS / "fastcan_narx.py",
            "Polynomial NARX with terms by make_narx and parameters by the error of the free run; degree 2 "
            "or 3, delays of 2 to 10 samples and 5 to 25 terms by the held-out quarter.",
        ),
        "pyoperon": Peer(
            "pyoperon",
            "0.6.2",
            _SCRIPTS / "pyoperon_regression.py",
            "Symbolic regression of the output or of its change on 2 to 8 lags, 100 000 evaluations on at "
            "most 2000 rows; length 15 or 30 and lags by the held-out quarter.",
            reads_several_outputs=False,
        ),
    }
)
