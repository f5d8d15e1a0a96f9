"""Synthetic motion with known loads. The truth shares no code with the estimators it judges."""

from __future__ import annotations

from forceid.scenes.recipe import SCENES as SCENES
from forceid.scenes.recipe import SceneRecipe as SceneRecipe
from forceid.scenes.recipe import fly as fly
from forceid.scenes.recipe import load_recipe as load_recipe
from forceid.scenes.recipe import measure as measure
from forceid.scenes.recipe import sample_times as sample_times
from forceid.scenes.recipe import simulate as simulate
