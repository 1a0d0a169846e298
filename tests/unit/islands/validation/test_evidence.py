"""Form of a model by what its output depends on."""

import pytest

from islands.models.latent import LatentModel
from islands.models.narx import parse_model
from islands.validation.evidence import name_form
