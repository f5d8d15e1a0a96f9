"""Bodies that move by an affine map, x = F(t) X: twelve degrees of freedom of turn, stretch and circulation.

Source: theory note on pseudo-rigid bodies.

>>> from forceid import pseudorigid
>>> round(float(pseudorigid.maclaurin(0.5).w) ** 2, 10)
0.1379936423
"""

from __future__ import annotations

from forceid.pseudorigid.body import METHODS as METHODS
from forceid.pseudorigid.body import Body as Body
from forceid.pseudorigid.factors.bipolar_path import BipolarPath as BipolarPath
from forceid.pseudorigid.factors.bipolar_path import bipolar_path as bipolar_path
from forceid.pseudorigid.factors.decomposition import BipolarRates as BipolarRates
from forceid.pseudorigid.factors.decomposition import bipolar as bipolar
from forceid.pseudorigid.factors.decomposition import bipolar_rates as bipolar_rates
from forceid.pseudorigid.factors.decomposition import polar as polar
from forceid.pseudorigid.factors.decomposition import polar_rates as polar_rates
from forceid.pseudorigid.material.formless import NoStress as NoStress
from forceid.pseudorigid.material.formless import PerfectGas as PerfectGas
from forceid.pseudorigid.material.material_law import Lame as Lame
from forceid.pseudorigid.material.material_law import Material as Material
from forceid.pseudorigid.material.materials import HadamardGreen as HadamardGreen
from forceid.pseudorigid.material.materials import MooneyRivlin as MooneyRivlin
from forceid.pseudorigid.material.materials import NeoHookean as NeoHookean
from forceid.pseudorigid.material.materials import StVenantKirchhoff as StVenantKirchhoff
from forceid.pseudorigid.material.ogden import Ogden as Ogden
from forceid.pseudorigid.material.stress import cauchy as cauchy
from forceid.pseudorigid.material.stress import piola as piola
from forceid.pseudorigid.material.stress import viscous as viscous
from forceid.pseudorigid.material.transverse import TransverselyIsotropic as TransverselyIsotropic
from forceid.pseudorigid.motion.constrained import multiplier as multiplier
from forceid.pseudorigid.motion.invariants import angular_momentum as angular_momentum
from forceid.pseudorigid.motion.invariants import circulation as circulation
from forceid.pseudorigid.motion.invariants import energy as energy
from forceid.pseudorigid.motion.invariants import kinetic_energy as kinetic_energy
from forceid.pseudorigid.motion.reference import AffineState as AffineState
from forceid.pseudorigid.motion.splittings import SPLITTINGS as SPLITTINGS
from forceid.pseudorigid.motion.trajectory import Event as Event
from forceid.pseudorigid.motion.trajectory import Trajectory as Trajectory
from forceid.pseudorigid.steady.ellipsoids import Ellipsoid as Ellipsoid
from forceid.pseudorigid.steady.ellipsoids import dedekind as dedekind
from forceid.pseudorigid.steady.ellipsoids import irrotational as irrotational
from forceid.pseudorigid.steady.ellipsoids import jacobi as jacobi
from forceid.pseudorigid.steady.ellipsoids import maclaurin as maclaurin
from forceid.pseudorigid.steady.ellipsoids import riemann_s as riemann_s
from forceid.pseudorigid.steady.ellipsoids import riemann_sequence as riemann_sequence
from forceid.pseudorigid.steady.gravity import GasCloud as GasCloud
from forceid.pseudorigid.steady.gravity import SelfGravity as SelfGravity
from forceid.pseudorigid.steady.index_symbols import index_symbols as index_symbols
from forceid.pseudorigid.steady.index_symbols import pair_symbols as pair_symbols
from forceid.pseudorigid.steady.natural_modes import NaturalModes as NaturalModes
from forceid.pseudorigid.steady.natural_modes import SpinningBody as SpinningBody
from forceid.pseudorigid.steady.natural_modes import natural_modes as natural_modes
from forceid.pseudorigid.steady.natural_modes import spinning_body as spinning_body
from forceid.pseudorigid.steady.rigid_body import RigidMotion as RigidMotion
from forceid.pseudorigid.steady.rigid_body import free_rotation as free_rotation
from forceid.pseudorigid.steady.spectra import Spectrum as Spectrum
from forceid.pseudorigid.steady.spectra import ellipsoid_spectrum as ellipsoid_spectrum
from forceid.pseudorigid.steady.spectra import rotating_spectrum as rotating_spectrum
from forceid.pseudorigid.steady.tilted import TiltedEllipsoid as TiltedEllipsoid
from forceid.pseudorigid.steady.tilted import riemann_tilted as riemann_tilted
