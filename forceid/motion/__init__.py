"""How a body moves, taken from tracks: poses of frames, free turns, derivatives by the classic routes.

Source: principal equations 4a, 4b.
"""

from __future__ import annotations

import sys

from forceid.face import NamedAlike
from forceid.motion.derivative import Derivatives as Derivatives
from forceid.motion.derivative import derivatives as derivatives
from forceid.motion.frames import Frames as Frames
from forceid.motion.frames import Pose as Pose
from forceid.motion.frames import beyond_pose as beyond_pose
from forceid.motion.frames import fit_frames as fit_frames
from forceid.motion.frames import fit_pose as fit_pose
from forceid.motion.frames import poses_about as poses_about
from forceid.motion.frames import second_order as second_order
from forceid.motion.free_rotation import SHOWN_TURN as SHOWN_TURN
from forceid.motion.free_rotation import SUBSTEP as SUBSTEP
from forceid.motion.free_rotation import WIDE_STEP as WIDE_STEP
from forceid.motion.free_rotation import apply as apply
from forceid.motion.free_rotation import free_turn as free_turn
from forceid.motion.free_rotation import largest_turn as largest_turn
from forceid.motion.free_rotation import momentum_between as momentum_between
from forceid.motion.free_rotation import rotation_vector_rate as rotation_vector_rate
from forceid.motion.free_rotation import substeps as substeps
from forceid.motion.pose import FrameFit as FrameFit
from forceid.motion.pose import body_axes as body_axes
from forceid.motion.pose import exp as exp
from forceid.motion.pose import fit_one as fit_one
from forceid.motion.pose import fit_rotation as fit_rotation
from forceid.motion.pose import frame_fit as frame_fit
from forceid.motion.pose import frames_seen_alike as frames_seen_alike
from forceid.motion.pose import log as log
from forceid.motion.pose import pose_gain as pose_gain
from forceid.motion.pose import pose_rank as pose_rank
from forceid.motion.pose import seen_together as seen_together
from forceid.motion.products import Products as Products
from forceid.motion.products import inertia_products as inertia_products
from forceid.motion.reading_cov import ReadingCov as ReadingCov
from forceid.motion.smoothing_spline import SmoothingSpline as SmoothingSpline
from forceid.motion.window import ORDER as ORDER
from forceid.motion.window import Window as Window
from forceid.motion.window import WindowChoice as WindowChoice
from forceid.motion.window import choose_window as choose_window
from forceid.motion.window import error_of_square as error_of_square
from forceid.motion.window import noise_growth as noise_growth
from forceid.motion.window import noise_variance as noise_variance
from forceid.motion.window import smooth_taper as smooth_taper
from forceid.motion.window import windows as windows

sys.modules[__name__].__class__ = NamedAlike  # forceid.motion(position, time, ...) is called so too
