# Made by islands._make_stub().
from islands.data.dataset import Dataset as Dataset
from islands.data.dataset import join as join
from islands.data.split import Split as Split
from islands.data.split import split as split
from islands.discrepancy.detectability import self_test as self_test
from islands.discrepancy.diagnosis import Diagnosis as Diagnosis
from islands.discrepancy.effects import EFFECTS as EFFECTS
from islands.discrepancy.interfaces.context import Parameter as Parameter
from islands.discrepancy.interfaces.effect import Effect as Effect
from islands.discrepancy.interfaces.effect import Site as Site
from islands.errors import IslandsError as IslandsError
from islands.errors import ModelError as ModelError
from islands.errors import RecordError as RecordError
from islands.errors import SettingsError as SettingsError
from islands.estimation.estimator_table import ESTIMATORS as ESTIMATORS
from islands.evolution.migration.topology import TOPOLOGIES as TOPOLOGIES
from islands.evolution.presets import PRESETS as PRESETS
from islands.evolution.settings import Settings as Settings
from islands.facade.diagnose import diagnose as diagnose
from islands.facade.diagnose import function_simulator as function_simulator
from islands.facade.explain_residual import explain_residual as explain_residual
from islands.facade.fit import fit as fit
from islands.facade.identify import identify as identify
from islands.facade.result import FittedModel as FittedModel
from islands.facade.result import Result as Result
from islands.facade.result import simulate as simulate
from islands.io.models import read_model as read_model
from islands.io.models import write_model as write_model
from islands.io.records import read_record as read_record
from islands.io.records import write_record as write_record
from islands.model.model import Model as Model
from islands.model.model import make_model as make_model
from islands.model.parsing import parse as parse
from islands.model.primitives import PRIMITIVES as PRIMITIVES
from islands.model.user_primitive import primitive as primitive

__version__: str
