"""Presets of a search, and the settings that a job may change."""

from typing import Any

from fastapi import APIRouter

from islands.evolution.presets import (
    AUTO,
    AUTO_SUMMARY,
    PRESET_NAMES,
    PRESET_SUMMARIES,
    common_settings,
    list_fixed_settings,
    list_structures,
)
from islands_api.schemas import PresetPage
from islands_api.web.auth import Reader
from islands_api.web.problems import RESPONSES
from islands_api.web.requests import StrictRoute
from islands_service.domain.job_spec import SettingsChanges

router = APIRouter(prefix="/v1/presets", tags=["jobs"], responses=RESPONSES, route_class=StrictRoute)


@router.get("", response_model=PresetPage)
async def presets(_caller: Reader) -> Any:
    """List the presets of a job with their settings, and describe the settings."""
    summaries = {AUTO: AUTO_SUMMARY, **PRESET_SUMMARIES}
    return {
        "items": [
            {
                "name": name,
                "summary": summaries[name],
                "settings": common_settings(name),
                "structures": list_structures(name),
                "fixed": list_fixed_settings(name),
            }
            for name in PRESET_NAMES
        ],
        "settings": SettingsChanges.model_json_schema()["properties"],
    }
