"""Synthetic motion with known loads. The truth shares no code with the estimators it judges.

What may be used from outside; each name loads on first use.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

from forceid.face import on_first_use

_HOMES = {
    "SCENES": "forceid.scenes.recipe",
    "SceneRecipe": "forceid.scenes.recipe",
    "load_recipe": "forceid.scenes.recipe",
    "simulate": "forceid.scenes.recipe",
    "fly": "forceid.scenes.recipe",
    "measure": "forceid.scenes.recipe",
    "sample_times": "forceid.scenes.recipe",
}
__all__ = [*_HOMES]

if TYPE_CHECKING:
    from forceid.scenes.recipe import SCENES as SCENES
    from forceid.scenes.recipe import SceneRecipe as SceneRecipe
    from forceid.scenes.recipe import fly as fly
    from forceid.scenes.recipe import load_recipe as load_recipe
    from forceid.scenes.recipe import measure as measure
    from forceid.scenes.recipe import sample_times as sample_times
    from forceid.scenes.recipe import simulate as simulate


__getattr__ = on_first_use(__name__, _HOMES)
