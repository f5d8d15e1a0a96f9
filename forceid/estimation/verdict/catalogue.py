"""Every finding that a verdict may hold: a table of code, level, sentence, meaning, and what to do.

One row a finding, so that a new one is one row here and a check that calls `note`. The page docs/findings.md
is made from this table. Codes are kept once they were released: people and programs rely on them.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from forceid.records import Finding, Level


@dataclass(frozen=True)
class Entry:
    """One kind of finding.

    level: the verdict it leads to by itself; sentence: a template over the values, that ends with the next
    step; meaning and action: the same for the documentation, without numbers.
    """

    code: str
    level: Level
    sentence: str
    meaning: str
    action: str


# fmt: off
RECORDING = (
    Entry(
        "no-mass-center", "refused",
        "no frame shows the mass center, and so no force and no moment: the markers seen do not span it; "
        "mark every node with mass, or add markers off their line",
        "The markers do not say where the mass center is, in any frame. Without its path there is no force.",
        "Put markers on all nodes with mass, or add markers until they fix a rigid body.",
    ),
    Entry(
        "mass-on-point", "ok",
        "all mass lies on a point: no moment acts about it, and the moment is zero by construction",
        "The body is a particle. Its moment about the mass center is exactly zero, whatever acts.",
        "Nothing, if that is the body you mean. Otherwise correct /body/mass and /body/position.",
    ),
    Entry(
        "mass-on-line", "ok",
        "all mass lies on a line: no moment acts along it, and that component is zero by construction; the "
        "two across follow from the direction of the line",
        "A body without breadth has no inertia about its own line, so no moment acts along it.",
        "Nothing, if that is the body you mean. Otherwise give the inertia of the body.",
    ),
    Entry(
        "line-direction-unseen", "degraded",
        "the mass lies on a line whose direction no marker shows: the moment is not seen, force only; "
        "mark a second point of that line",
        "All mass is on one line, and the markers do not show how that line points.",
        "Add a marker at a second point of the line.",
    ),
    Entry(
        "no-inertia", "degraded",
        "the inertia tensor is not given: force only; add /body/inertia for the moment",
        "The file gives a total mass, but not how it is spread. The force is right; there is no moment.",
        "Add /body/inertia, or masses of the nodes.",
    ),
    Entry(
        "no-orientation", "degraded",
        "no orientation was measured: force only; add /motion/orientation for the moment",
        "The file holds the path of the mass center alone. The force is right; there is no moment.",
        "Add /motion/orientation.",
    ),
    Entry(
        "one-marker", "degraded",
        "one marker is a particle: rotation and moment are not seen; add two markers off a line",
        "A single marker shows no rotation. If it is off the mass center, the force holds its swing too.",
        "Add two markers, not on one line with the first.",
    ),
    Entry(
        "markers-on-line", "degraded",
        "the {count} markers lie on a line, and a turn about it is not seen: force only; "
        "add a marker off the line",
        "Markers on one line do not show a turn about that line, and the moment needs the whole rotation.",
        "Add a marker off the line.",
    ),
    Entry(
        "markers-nearly-on-line", "degraded",
        "the markers lie almost on a line, condition {condition:.0f}: 1 mm of noise turns the "
        "body by {turn_deg:.2g} degrees; add a marker off the line",
        "The turn about one axis is known badly, and with it the moment.",
        "Add a marker far from the line that the others make.",
    ),
    Entry(
        "shape-looks-rigid", "degraded",
        "{shape} moves the markers almost as a rigid motion does, sine of the angle "
        "{sine:.2g}: {percent:.2g} % of it is taken for rigid motion, and force and "
        "moment trade with it; spread the markers, or add strain gauges",
        "Where the markers are, a mode of the body looks like a rigid motion. The fit mixes the two.",
        "Put markers where the mode moves the body most, or add strain gauges.",
    ),
    Entry(
        "sensors-left-out", "degraded",
        "the sensors on the body are left out: of a body whose mass lies near a line or on a point they "
        "do not go together with markers; take the markers out to see what the sensors say",
        "For a body this thin, the method uses either markers or sensors. It used the markers.",
        "Estimate a copy of the file without markers, and compare both.",
    ),
    Entry(
        "unmarked-mass", "degraded",
        "{count} nodes carry mass but no marker, and the body deforms: their share of force and moment "
        "is that of the undeformed shape; mark them, or give mode shapes",
        "Mass that no marker shows is taken to move with the rigid body, though the body deforms.",
        "Put markers on these nodes, or give /body/mode_shape.",
    ),
    Entry(
        "frames-lost", "ok",
        "{lost} of {frames} frames show no pose, the longest run {longest} frames: there the "
        "estimate is bridged or missing; expect detail only outside",
        "In a gap the result follows from what is before and after it, and claims as much as that is known.",
        "Short events in a gap are lost: restore the markers there if one is possible.",
    ),
    Entry(
        "fast-turn", "degraded",
        "the body turns {degrees:.0f} degrees between frames, near or past the half turn at "
        "which the sense and number of turns are lost: what is read as {rev_per_s:.3g} rev/s may be "
        "{other_rev_per_s:.3g} rev/s the other way; record faster, or add a gyro, or a magnetometer that "
        "reads between frames",
        "Frames this far apart do not say which way the body turned. The moment may be far off.",
        "Record at a higher rate, or add a gyro, or a magnetometer that reads between frames.",
    ),
    Entry(
        "turn-by-moment", "degraded",
        "the body turns up to {degrees:.0f} degrees a frame, and the moment found changes its "
        "angular momentum by {part:.0%} in each: as turns "
        "past half a revolution do that are taken for shorter ones; record faster or add a gyro",
        "The moment is as large as one that a wrong count of turns makes.",
        "Record at a higher rate, or add a gyro.",
    ),
    Entry(
        "rounded-coordinates", "degraded",
        "coordinates are rounded to steps of {step_mm:.2g} mm, more than their noise of "
        "{noise_mm:.2g} mm: errors follow the motion, and force and moment with them; "
        "export more digits",
        "The file holds too few digits. Errors of rounding are not noise: they repeat with the motion.",
        "Export the positions again with more digits.",
    ),
    Entry(
        "rounded-times", "degraded",
        "times are rounded to steps of {step_ms:.2g} ms: at the speed of the body that shifts its mass "
        "center by {shift_mm:.2g} mm, in a pattern that repeats and passes for force; export more digits, or "
        "times of an even clock of {rate_hz:.6g} Hz",
        "The file holds the times of an even clock with too few digits. A moving body is then elsewhere than "
        "at the time given, and the pattern of that is taken for a force.",
        "Export the times again with more digits, or write frame number over rate in their place.",
    ),
    Entry(
        "markers-stuck", "degraded",
        "markers stick at {axis} = {edge_m:.4g} m in {count} of {frames} frames, the edge of "
        "the volume or of a limit: they were not there, and pull the pose with them; write "
        "NaN in these frames",
        "A marker has one and the same extreme value again and again, as where a limit cuts it off.",
        "Write NaN for these readings.",
    ),
    Entry(
        "markers-exchanged", "ok",
        "markers traded places ({markers}): exchanged back {count} times, first at {time_s:.4g} s; look at "
        "the labels, and at what the exchange leaves",
        "Two labels were swapped for a while. The program swapped them back.",
        "Correct the labels in the source, and look at the frames around the exchange.",
    ),
    Entry(
        "spikes", "ok",
        "{count} of {readings} marker readings rejected as spikes ({markers}), the first at {time_s:.4g} s; "
        "look at these markers there",
        "Single readings jump away and back, as no body does. They were left out.",
        "Look at these markers. If the jump is real (a blow), record faster.",
    ),
    Entry(
        "many-spikes", "degraded",
        "more than one in twenty of the marker readings were rejected as spikes: what is left may be wrong "
        "too; look at the tracks",
        "So many readings jump that they are no single mistakes. The other readings may be wrong as well.",
        "Look at the calibration, the labels and the reconstruction of the markers.",
    ),
    Entry(
        "frames-rejected", "ok",
        "frames rejected as outliers: {count} ({alone} alone, {in_bursts} in bursts), "
        "the first at {time_s:.4g} s, up to {sigma:.0f} sigma off; look at the markers there",
        "Whole frames agree with nothing before and after them. They were left out.",
        "Look at the markers in these frames.",
    ),
    Entry(
        "many-rejected", "degraded",
        "{count} of {frames} frames were rejected as outliers: as many may be left that are not far enough "
        "off to be found; look at the tracks",
        "So many frames are wrong that others will be wrong by less, and make the noise larger than claimed.",
        "Look at the calibration, the labels and the reconstruction of the markers.",
    ),
    Entry(
        "rejected-together", "degraded",
        "{together} of the {count} frames rejected as outliers stand in {span} samples, as mistakes do not "
        "by chance: if the body moved so, as under a blow, its load there is lost",
        "Frames that are off one after the other may be a motion that the load model does not follow.",
        "Look at the markers there. If it is an impact, record faster; if not, take these frames out.",
    ),
    Entry(
        "wild-innovations", "degraded",
        "innovations reach {sigma:.0f} sigma, first past {limit:.0f} at {time_s:.4g} s: an impact "
        "faster than the prior follows, or markers that changed places; force and moment are blurred "
        "around such times",
        "The motion jumps by more than the load model allows. The load there is smeared over time.",
        "If it is an impact, record faster. If not, look at the labels of the markers.",
    ),
)

NOISE = (
    Entry(
        "few-frames", "degraded",
        "{frames} frames are too few to tell how force and moment vary: claimed errors may be "
        "too small by a factor of two; record longer",
        "From so short a record the size and speed of the load are guessed badly, and so are the errors.",
        "Record longer, or take the claimed errors times two.",
    ),
    Entry(
        "noise-measured", "ok",
        "the noise of {variable} is stated as {stated:.2g}; what no motion of the body makes shows "
        "{noise:.2g}, which is taken",
        "Markers on one body show by themselves how large their errors are: not as large as was stated.",
        "Nothing is to be done, unless all markers err alike: that is an error which they cannot show.",
    ),
    Entry(
        "smoothed-at-source", "degraded",
        "errors of the markers end near {cut_hz:.2g} Hz: the tracks were smoothed before, and what the load "
        "does faster than that is not in the record nor in the claim",
        "A filter took away noise and motion alike. What it took away cannot be seen any more.",
        "Give the data before filtering.",
    ),
    Entry(
        "noise-heavy", "degraded",
        "errors of markers are far from normal, kurtosis {kurtosis:.1f}: some readings are much worse than "
        "others, and force and moment follow them; look at the tracks",
        "A few markers, or a few frames, are wrong by far more than the rest. All of them count alike.",
        "Take the bad readings out (NaN), or look at the reconstruction of the markers.",
    ),
    Entry(
        "gaps-in-windows", "degraded",
        "{lost} of {frames} frames show no pose: windows of this method reach over the gaps, and claims take "
        "the load for smooth there; use --method smoother",
        "Differences over gaps are long, and what the load does between is not in the claim.",
        "Use the smoother, or restore the markers.",
    ),
    Entry(
        "noise-at-floor", "degraded",
        "the likelihood drove the noise of {variable} to its floor ({noise:.1e}): the record "
        "was smoothed before, or its errors are not white, and the claimed errors are too small; "
        "state noise_std.{variable}",
        "The record looks smoother than any camera or sensor is. Somebody filtered it, most likely.",
        "State the noise of the instrument, or give the data before filtering.",
    ),
    Entry(
        "noise-unresolved", "degraded",
        "the noise of {variable} was not stated, and the record does not resolve it: it looks "
        "{growth:.1f} times larger in every second frame; claimed errors are too small; "
        "state noise_std.{variable}, or record faster",
        "The motion is so fast that noise and motion cannot be told apart from the record alone.",
        "State the noise of the instrument, or record at a higher rate.",
    ),
    Entry(
        "noise-color-unseen", "degraded",
        "{frames} frames are too few to tell whether the errors of {variable} are white, as the "
        "claimed errors assume; state noise_std.{variable}, or record longer",
        "The claimed errors rest on noise that is new in every frame. So few frames cannot show that.",
        "State the noise of the instrument, or record longer.",
    ),
    Entry(
        "slow-errors-allowed", "degraded",
        "the tracks are smoother than independent errors of the stated size allow: {noise:.1e} is taken, the "
        "larger of that and of what the spectrum of the mass center shows where the motion ends; the claimed "
        "errors allow for slow errors of it; markers that slide together, or a wrong body, cost more",
        "The errors of the markers are slow, not new in every frame: the record was smoothed, or skin moves.",
        "Give the data before filtering. Take the claimed errors as a lower bound.",
    ),
    Entry(
        "slow-errors", "degraded",
        "the tracks are smoother than independent errors of the stated size allow: slow errors pass for "
        "force, and the claimed errors are too small where markers slide or were smoothed",
        "The same, for a method by differences, which makes no allowance for it.",
        "Use --method smoother, or give the data before filtering.",
    ),
    Entry(
        "noise-hidden", "degraded",
        "the noise of {variable} was not stated, and the record does not show it: it was smoothed before, or "
        "its errors are not white; {noise:.1e} is taken, as the spectrum of the mass center shows where the "
        "motion ends, and the claimed errors allow for slow errors of that size; state noise_std.{variable}",
        "The noise is a guess, since smoothing has taken away what would show it.",
        "State the noise of the instrument.",
    ),
    Entry(
        "moment-lever", "degraded",
        "the moment is about the mass center of the model: where that is {off_mm:.0f} mm off, as in bodies "
        "of parts that are known by tables, the force makes {moment:.2g} N m of it, and the claim of "
        "{claim:.2g} N m leaves that out; state body_std.mass_center, or check masses and their places",
        "Force times the error of the mass center is an error of the moment. The claimed error lacks it.",
        "State how far off it may be (body_std), or give the moment about a point you know (moment_about).",
    ),
    Entry(
        "innovations-large", "degraded",
        "the innovations are {times:.2f} times as large as predicted: claimed errors are too small by about "
        "that; check noise_std and the model",
        "The data are farther from the prediction than the stated noise and the model allow.",
        "Check noise_std. If it is right, the body deforms or the labels are wrong.",
    ),
    Entry(
        "innovations-small", "degraded",
        "the innovations are {times:.2f} times as large as predicted: the tracks are smoother than the noise "
        "they are said to have; check noise_std",
        "The data are closer to the prediction than the stated noise allows.",
        "Check noise_std, and whether the tracks were filtered.",
    ),
    Entry(
        "innovation-wild", "degraded",
        "an innovation reaches {sigma:.1f} sigma, at {time_s:.4g} s, as by chance in one record of a "
        "hundred: there the load changes faster than the prior, or a marker is off, and claimed errors are "
        "too small",
        "One reading is farther from its prediction than chance explains.",
        "Look at the markers and at the load at that time.",
    ),
    Entry(
        "innovations-correlated", "degraded",
        "the innovations of {channel} are correlated ({correlation:+.2f} from one frame to the next): "
        "the errors of the markers are not white, or the load changes faster than the prior; "
        "claimed errors are too small",
        "Errors of neighboring frames resemble each other, so averaging helps less than claimed.",
        "Check for filtered tracks. If they are raw, record faster.",
    ),
    Entry(
        "innovations-line", "degraded",
        "the innovations of {channel} hold a line at {frequency_hz:.3g} Hz: a load there, often at the spin "
        "or twice the spin, is followed only in part; take its amplitude as a lower bound",
        "A load swings at one frequency, and the estimate follows only a part of it.",
        "Name the frequency in `lines`, or take the amplitude there as a lower bound.",
    ),
    Entry(
        "off-plain-route", "degraded",
        "the {load} along {axis} is {own:.2g} {unit} rms, {plain:.2g} {unit} by the plain route, "
        "the low-passed second derivative: up to {band_hz:.2g} Hz they are {apart:.2g} {unit} apart, "
        "{errors:.1f} joint errors{others}; the claim is widened by what they are apart; compare "
        "both (/witness), and look at the body, the model and the tracks",
        "A low-pass and two derivatives give another load, by more than the errors of both.",
        "Compare both in the report. Look for wrong labels, a wrong mass or a wrong model.",
    ),
    Entry(
        "plain-route-instead", "degraded",
        "{where} {what}: force and moment are those of the plain route, low-passed second "
        "derivatives, and are followed up to its cut-off alone (/witness); {next_step}",
        "The method asked for has no solution. The result is a low-pass and two derivatives.",
        "Do what the sentence says, or use the result up to its cut-off.",
    ),
)

SHAPE = (
    Entry(
        "reference-differs", "degraded",
        "the mean shape leaves the reference shape by {off_mm:.2g} mm at {marker}, on a "
        "body of {size_mm:.2g} mm: labels or /body/position are wrong, and with them mass center and "
        "inertia, or the body bends that far; check both",
        "The markers are, all the time, elsewhere on the body than the file says.",
        "Check the labels and /body/position.",
    ),
    Entry(
        "too-light", "degraded",
        "a body of {mass_kg:.3g} kg that is {length_m:.3g} m long is lighter than any: positions are in "
        "other units than they say, or the mass is wrong; set the attribute units of the positions and "
        "of /body/position",
        "No body of this length is so light. Most likely millimeters were read as meters.",
        "Set the attribute `units` of the positions.",
    ),
    Entry(
        "unmarked-mass-in-modes", "degraded",
        "{count} nodes carry mass but no marker, and an affine strain moves them otherwise than "
        "the modes of the file do: force and moment are limited by the model; use --model modal",
        "The affine model guesses how mass without markers moves, though the file knows its modes.",
        "Use --model modal or auto.",
    ),
    Entry(
        "shape-left", "degraded",
        "the markers leave the {model} shape by {off_mm:.2g} mm rms, chi-square {chi_square:.1f} per "
        "degree of freedom: force and moment are limited by the model; use --model auto",
        "The body deforms by more than the noise, and in ways that the model does not have.",
        "Use --model auto, or check the labels.",
    ),
    Entry(
        "rigid-shape-left", "degraded",
        "the markers leave the rigid shape by {off_mm:.2g} mm rms, chi-square {chi_square:.1f} per "
        "degree of freedom, and total mass and inertia do not say where the mass goes: force and moment "
        "are those of a body that keeps its shape, and limited by that; give /body/mass with markers on "
        "it, or mode shapes",
        "The body deforms, but the file has only its total mass. Nobody knows how the mass moves then.",
        "Give masses of the nodes, or mode shapes.",
    ),
    Entry(
        "errors-shared", "degraded",
        "the markers agree with each other to {agree_mm:.2g} mm, better than the "
        "{noise_mm:.2g} mm by which their mass center errs: noise_std is too large, or they share slow "
        "errors, which pass for force; look at the calibration of the cameras",
        "Markers agree among each other better than the noise stated. Errors that all share stay unseen.",
        "Check noise_std and the calibration of the cameras.",
    ),
)

LOADS = (
    Entry(
        "vibration-in-band", "degraded",
        "shape {shape} of the deformation vibrates at {frequency_hz:.3g} Hz, inside the band of "
        "the force, followed up to {band_hz:.2g} Hz, and leaks into the mean motion: up to "
        "{force:.2g} N may be vibration and not load; mark the nodes that carry the mass, or give "
        "mode shapes",
        "A vibration of the body moves the fitted mass center, and passes for a force.",
        "Put markers on the nodes with mass, or give /body/mode_shape.",
    ),
    Entry(
        "many-weights", "degraded",
        "half of the record shows a force of over {times:.0f} times the weight: positions, "
        "times or mass are in other units than they say, unless it is a blow; check the attribute units",
        "No body bears such a force for long. Most likely a unit is wrong.",
        "Check the units of positions, times and mass.",
    ),
    Entry(
        "load-kinks", "degraded",
        "the {load} found kinks from frame to frame, as under blows, or where markers share slow "
        "errors, noise_std is too small, or the body deforms in ways that the model does not follow; its "
        "claim is several times wider for it; look at the tracks, and state noise_std as it is",
        "The load is as rough as the model allows. That is right for blows, and suspicious elsewhere.",
        "Look at the tracks. Check noise_std and the model.",
    ),
    Entry(
        "loads-in-combination", "degraded",
        "the loads {names} are determined in combination only, and their split is the one "
        "of least norm; read null_space and estimable, or ask for fewer loads",
        "Several of the loads asked for do exactly the same to the body. Only their sum is known.",
        "Ask for fewer loads, or read `null_space` and `estimable` of /load.",
    ),
    Entry(
        "loads-alike", "degraded",
        "the loads {names} do nearly the same to the body: an error of the wrench comes out "
        "{times:.0f} times as large in their split; ask for fewer loads",
        "Several of the loads asked for are nearly the same. Their split is known badly.",
        "Ask for fewer loads, or place them farther apart.",
    ),
    Entry(
        "loads-unexplained", "degraded",
        "the loads leave a part of the wrench unexplained, chi-square {chi_square:.1f} per "
        "degree of freedom: other loads act; add them",
        "The loads asked for cannot make the force and moment found.",
        "Add the loads that are missing, or correct points and directions.",
    ),
    Entry(
        "line-at-spin", "degraded",
        "a {load} of up to {hidden:.2g} {unit} at {times} the spin would hide in the noise, and "
        "the claim of {claim:.2g} {unit} leaves it out; if one may act, record faster, or use "
        "more markers",
        "Loads on spinning bodies often swing at the spin. One of that size would not show here.",
        "If such a load is possible, record faster or use more markers.",
    ),
    Entry(
        "faster-on-modes", "ok",
        "loads on the modes of the body swing faster than the motion of the whole body shows: beyond "
        "{frequency_hz:.3g} Hz a {load} of {hidden:.2g} {unit} rms would hide in the noise; the claim of "
        "{claim:.2g} {unit} allows for it",
        "The deformation shows loads that are faster than what the motion of the whole body shows of them.",
        "Nothing, or record faster with less noise for a smaller claim.",
    ),
    Entry(
        "free-oscillation", "degraded",
        "a free oscillation at {frequency_hz:.3g} Hz, as of a nutation, shows in the {load}; what it does "
        "to the rest of the wrench is below the noise: claimed errors allow for all that could hide there; "
        "reduce the noise, or record at a higher rate",
        "The body nutates. In other components that swing is too small to see, and the claim allows for it.",
        "Reduce the noise, or record at a higher rate, for smaller claims.",
    ),
    Entry(
        "load-in-pieces", "ok",
        "the {load} changes its character {edges} times, first at {first_s:.4g} s, last at {last_s:.4g} s: "
        "it is another load in each piece, and `impulse` says what each gives",
        "A step, an impact or a contact: between two edges the load is of one character, and another beyond.",
        "Nothing. The claim counts where an edge may lie; an impulse is known far better than a peak.",
    ),
    Entry(
        "beside-known", "ok",
        "force and moment are those of all loads but the known ones, {names}, of {force:.3g} N and "
        "{moment:.3g} N m rms; what these leave open is claimed",
        "The result is what acts beside the loads that were stated, not all that acts.",
        "Nothing, if that is what you ask. Add `known_force` and `known_moment` for all that acts.",
    ),
    Entry(
        "inner-wheel", "degraded",
        "an angular momentum inside the body, ({h_x:.2g}, {h_y:.2g}, {h_z:.2g}) kg m2/s in body axes, would "
        "make {made:.2g} of the {moment:.2g} N m of moment found: a wheel, a rotor or a liquid turns in it, "
        "or else a load turns with it; state it as internal_momentum, or [0, 0, 0] where nothing turns "
        "inside",
        "Something that turns inside the body explains the record far better than a moment from outside.",
        "State `internal_momentum`: what turns inside, or zeros if nothing does.",
    ),
    Entry(
        "inner-wheel-possible", "degraded",
        "an angular momentum inside the body, ({h_x:.2g}, {h_y:.2g}, {h_z:.2g}) kg m2/s in body axes, would "
        "make {made:.2g} of the {moment:.2g} N m of moment found: the record does not tell a moment from a "
        "wheel, a rotor or a liquid that turns in it; state it as internal_momentum, or [0, 0, 0] where "
        "nothing turns inside",
        "The record does not say whether a moment acts or something turns inside the body.",
        "State `internal_momentum`: what turns inside, or zeros if nothing does.",
    ),
)

SENSORS = (
    Entry(
        "clock-off", "degraded",
        "the {sensors} read {offset_ms:.3g} ms {sense} than their samples say, with a standard "
        "error of {error_ms:.2g} ms: taken into account; set the clocks",
        "The clock of the sensors does not agree with that of the markers. The result is corrected for it.",
        "Synchronize the clocks, or correct the times of the sensors.",
    ),
    Entry(
        "bias-wanders", "degraded",
        "the biases of the {sensors} wander, by {walk:.2g} {unit} in a second, or "
        "what passes for it: they stand or point elsewhere than stated, or the body bends; look at "
        "their places, or state noise_std.{variable}_walk",
        "The sensors drift against the markers by more than a constant bias.",
        "Check where the sensors stand and point. If they drift, state how much.",
    ),
    Entry(
        "sensor-innovations", "degraded",
        "the innovations of the {sensors} are {times:.2f} times as large as predicted: "
        "they stand or point elsewhere than stated, their clock drifts, or the body bends under them; "
        "claimed errors are too small",
        "Sensors and markers contradict each other.",
        "Check places and directions of the sensors, and their clock.",
    ),
    Entry(
        "strain-shape-missing", "degraded",
        "strain was read, but /body/strain_shape, what each gauge reads of the nodes, is missing: the gauges "
        "tell nothing",
        "The file holds strain, but does not say what the gauges measure.",
        "Add /body/strain_shape.",
    ),
    Entry(
        "strain-without-modes", "degraded",
        "strain was read, but the body is taken for one without modes: the gauges tell nothing",
        "Strain gauges show bending, and the model has none.",
        "Give /body/mode_shape, or use --model modal.",
    ),
    Entry(
        "strain-innovations", "degraded",
        "the innovations of the strain gauges are {times:.2f} times as large as predicted: the "
        "body bends in more modes than the model has, or /body/strain_shape is not what they read; claimed "
        "errors are too small",
        "Strain gauges and markers contradict each other.",
        "Check /body/strain_shape, or give more modes.",
    ),
    Entry(
        "no-gyro", "refused",
        "no marker, no mean motion and no gyro of three axes: how the body turns is not observable, and "
        "so neither is the direction of what the other sensors read; add a gyro, or markers",
        "Nothing in the file shows how the body turns.",
        "Add a gyro of three axes, or markers.",
    ),
    Entry(
        "no-inertia-for-sensors", "refused",
        "the inertia tensor is not given, and sensors alone need it; add /body/inertia",
        "Without markers the method follows the rotation by its dynamics, which need the inertia.",
        "Add /body/inertia.",
    ),
    Entry(
        "no-place", "degraded",
        "no marker and no mean motion was measured: place, speed and the attitude at the start are not "
        "observable; force and moment stand in the axes of the body at the first sample, and place and speed "
        "are left out; add markers, or a measured pose",
        "Sensors on the body do not show where it is. World axes are those of the first sample.",
        "Nothing, if these axes do. Otherwise add markers.",
    ),
    Entry(
        "bias-not-stated", "degraded",
        "biases of the accelerometers are not stated, and one that all of them share reads as a force "
        "does that turns with the body: such a force is not told apart from one; state "
        "noise_std.specific_force_bias from a record at rest",
        "A bias of the accelerometers looks like a force that turns with the body.",
        "Record the sensors at rest, and state noise_std.specific_force_bias.",
    ),
    Entry(
        "attitude-drifts", "degraded",
        "attitude is reckoned from the gyros: by the end it has drifted by {drift_deg:.2g} degrees of "
        "standard error, and turns force and moment in the axes of the start by as much; in body axes they "
        "are right",
        "Without markers the direction of force and moment in the world is known less and less.",
        "Read force and moment in body axes, or add markers.",
    ),
    Entry(
        "turn-not-resolved", "degraded",
        "the body turns by {turn_rad:.2g} rad in a step of the model: what a load that turns with it does "
        "in between is not resolved, and claimed errors may be many times too small; raise the sample "
        "rate",
        "The body turns too far from sample to sample.",
        "Raise the sample rate.",
    ),
    Entry(
        "path-not-at-rest", "degraded",
        "the path of the rotation does not come to rest: what it still moves by is "
        "{left:.2g} times the error claimed of it otherwise, and a part of the claim; raise the "
        "sample rate, or state noise_std.angular_velocity_bias from a record at rest",
        "The iterations for the rotation did not converge. What is left is in the claimed error.",
        "Raise the sample rate, or state the bias of the gyros.",
    ),
    Entry(
        "no-accelerometer", "degraded",
        "no accelerometer reads: no force; add one, or markers",
        "Gyros alone show the moment, and no force.",
        "Add an accelerometer, or markers.",
    ),
    Entry(
        "bias-as-force", "degraded",
        "biases of the accelerometers pass for force: its claimed error is {claim:.2g} N beside "
        "{force:.2g} N; state noise_std.specific_force_bias from a record at rest",
        "The biases are so badly known that the force is not much more than they are.",
        "Record the sensors at rest, and state noise_std.specific_force_bias.",
    ),
    Entry(
        "force-in-bias", "degraded",
        "a force of up to {force:.2g} N that turns with the body may be among the biases of the "
        "accelerometers, and is not in the claimed error",
        "The estimate took a constant reading for bias. A force that turns with the body reads the same.",
        "State noise_std.specific_force_bias from a record at rest.",
    ),
)

AFFINE = (
    Entry(
        "stretch-open", "degraded",
        "the markers lie in a plane: the stretch across it is open",
        "Markers in a plane do not show how the body stretches across it.",
        "Add a marker off the plane.",
    ),
    Entry(
        "stretch-without-breadth", "degraded",
        "the body has no breadth across a plane: its stretch across is not told",
        "All mass lies in a plane. A stretch across it moves no mass.",
        "Nothing, if that is the body you mean.",
    ),
    Entry(
        "affine-force-open", "degraded",
        "the mass center lies off the plane of the markers: the force is open",
        "A body that stretches freely may carry its mass center anywhere off the plane of its markers.",
        "Add a marker off the plane, or use --model rigid or modal.",
    ),
    Entry(
        "first-moments-open", "degraded",
        "the markers lie in a plane and the body has breadth across it: its first moments of force are open; "
        "give a marker off the plane",
        "The nine first moments of force need the stretch across the plane of the markers.",
        "Add a marker off the plane.",
    ),
    Entry(
        "stress-open", "degraded",
        "the stretch of the body is open in part: so is the stress in it, and the first moments applied",
        "Stress follows from the whole stretch, and a part of that is not seen.",
        "Add a marker off the plane.",
    ),
    Entry(
        "no-applied-moments", "degraded",
        "first moments applied are not told from the stress in the body: {error}",
        "A material is stated, but the motion does not go together with it.",
        "Look at the constants under [material] or in /body/material.",
    ),
    Entry(
        "no-modal-force", "ok",
        "forces on the modes of the body are not told, since nothing says how stiff those are; add "
        "/body/mode_frequency to /body/mode_shape",
        "Only the stiffness of a mode tells what pushes it from how it moves. Force and moment need none.",
        "Give the frequency of every mode, or the stiffness of the body.",
    ),
    Entry(
        "load-answers-mode", "ok",
        "mode {mode} swings at {found_hz:.4g} Hz, where its stiffness says {told_hz:.4g} Hz, with "
        "{damping:.2g} of the critical damping beside: a load that answers the motion, as of air, is told "
        "with the forces on modes; if none can act, look at the stiffness",
        "The record is far likelier if loads depend on how the body bends, as springs and brakes do.",
        "Nothing, where the body moves in air or water. Else check /body/stiffness and the masses.",
    ),
    Entry(
        "stretch-in-noise", "degraded",
        "a frame shows the stretch to {stretch:.2g} only: markers are as noisy as the body is thick, and "
        "loads may be lost in that; look at the noise of {noise_m:.2g} m, or spread the markers",
        "The body is hardly larger than the noise of its markers.",
        "Spread the markers, or reduce the noise.",
    ),
    Entry(
        "modes-left-out", "degraded",
        "the nodes are {beside_mm:.2g} mm rms beside an affine body, with noise of {noise_mm:.2g} mm; "
        "of so large a file mean motion and first moments are exact, modes are left out; check with fewer "
        "frames",
        "A file too large for memory is reduced to an affine body. This one does more than that.",
        "Estimate a shorter part of the file, and compare.",
    ),
)

IDENTIFIED = (
    Entry(
        "no-free-flight", "refused",
        "no free flight of an elastic body goes through the motion: nothing is told of its material; give a "
        "record in which it is let go deformed, and nothing but weight acts",
        "The constants of a material show in how the body swings by itself. No such motion was found.",
        "Let the body go deformed, and record some periods of its slowest mode.",
    ),
    Entry(
        "flight-misfit", "degraded",
        "the likeliest free flight leaves {misfit:.3g} times the variance of the noise, by chance up to "
        "{limit:.3g}: something else acts, or the material has another law; intervals are widened, and may "
        "be too narrow still",
        "The motion is not that of this material under its weight alone, within the noise of the markers. "
        "Beyond four times the variance the constants are refused.",
        "Look for loads, supports and air; name another law under [material]; look at /body/position.",
    ),
    Entry(
        "flight-noise-stated", "degraded",
        "frames hold too few markers to tell the noise: {noise_mm:.2g} mm is taken as stated, or by rough "
        "differences, and the intervals with it; mark five points or more",
        "Four markers follow any affine map exactly. The noise, and whether the motion fits, is not checked.",
        "Mark five points or more, or state noise_std and trust it.",
    ),
    Entry(
        "center-pushed", "degraded",
        "the mass center leaves a free fall by {misfit:.3g} times the variance of the noise: a force acts, "
        "and first moments may act with it",
        "A body in free flight falls as a point does. This one is pushed; constants hold if only at its "
        "mass center.",
        "Look for air, strings and supports, and at gravity, masses and /body/position.",
    ),
    Entry(
        "constants-open", "refused",
        "the motion does not tell the material: lam is {lam:.3g} +- {lam_half:.2g} J, mu is {mu:.3g} +- "
        "{mu_half:.2g} J (95 %); let the body go further deformed, or record it longer",
        "The intervals of the shear or of the bulk modulus reach zero: the body hardly deforms.",
        "Let it go further deformed, or record it longer.",
    ),
    Entry(
        "constants-wide", "degraded",
        "the material is told roughly: lam is {lam:.3g} +- {lam_half:.2g} J, mu is {mu:.3g} +- {mu_half:.2g} "
        "J (95 %); let the body go further deformed, or record it longer",
        "An interval is wider than a tenth of the shear modulus. It is honest all the same.",
        "Let it go further deformed, or record it longer.",
    ),
    Entry(
        "mode-still", "degraded",
        "mode {mode} is not seen to swing above the noise: its frequency and damping are open; strike the "
        "body where that mode moves it",
        "Frequency and damping show in a swing alone. This mode had none that stands out.",
        "Strike the body where the mode moves it, or mark it there.",
    ),
    Entry(
        "mode-misfit", "degraded",
        "the swing of mode {mode} leaves {misfit:.3g} times the variance of the noise: something drives it, "
        "or it is no mode of this body; intervals are widened, and may be too narrow still",
        "The amplitude is not that of one free, damped oscillator about a steady shape.",
        "Look for loads, for other modes beside it and at /body/mode_shape; let the body spin less.",
    ),
    Entry(
        "law-open", "degraded",
        "the motion does not tell {law} from {rival}, log-likelihood {gain:.2g}, and their constants are "
        "{apart:.2g} J apart; name the law under [material]",
        "Two laws explain the motion about as well, with different constants.",
        "Name the law under [material] or in /body/material.",
    ),
)

JOINTS = (
    Entry(
        "whole-body-fails", "refused",
        "the whole body {error}",
        "A body in parts has no estimate as one body. Its parts and joints still have theirs.",
        "Read the results of the parts and joints.",
    ),
    Entry(
        "part-without-moment", "refused",
        "part {part}: its markers show no moment, and without it no joint force follows",
        "Forces in joints follow from force and moment of every part.",
        "Give that part three markers off a line.",
    ),
    Entry(
        "no-common-frame", "degraded",
        "no frame shows the poses of all parts: no joint force follows",
        "Forces in joints need all parts at the same time.",
        "Restore markers, or leave out the part that is not seen.",
    ),
    Entry(
        "joint-undetermined", "degraded",
        "the motion does not tell what passes through {names}: the joints close a loop, or loads "
        "from outside act on too many parts; see null_space, or state what a joint cannot pass",
        "Several sets of joint forces make the same motion. Where no joint is determined, all is refused.",
        "State what a joint cannot pass (its kind), or which part has no load from outside.",
    ),
    Entry(
        "joint-nearly-undetermined", "degraded",
        "the motion all but hides what passes through {names}: the joints close a loop but "
        "for the noise of the poses; state what a joint cannot pass",
        "Only noise keeps a loop of joints open. The forces will have very large errors.",
        "State what a joint cannot pass (its kind).",
    ),
    Entry(
        "balances-open", "degraded",
        "the balances of the parts do not close: what is left is {left:.3g} times "
        "what the claims allow, at most {limit:.2g} by chance; check masses and joints, or mark "
        "the part that a load from outside acts on with external = true",
        "Forces of the parts contradict each other. Far beyond the claims, the joint forces are refused.",
        "Check masses and joints, and mark the part on which a load from outside acts.",
    ),
    Entry(
        "joint-apart", "degraded",
        "the parts are {off_mm:.2g} mm apart at joint {joint}, where noise explains "
        "{noise_mm:.2g} mm: the joint is not there, and its moment is off; correct `at`",
        "The place given for the joint is not the same point on both parts.",
        "Correct `at` of the joint.",
    ),
    Entry(
        "joint-moves", "degraded",
        "the parts move against each other at joint {joint} by {times:.2g} times what noise "
        "explains, as a {kind} does not let; correct kind, axis or at, or a part bends",
        "The parts do what a joint of this kind forbids, or bend. The joint was not used to smooth them.",
        "Correct kind, axis or place of the joint; for parts that bend, expect the larger claims.",
    ),
    Entry(
        "joint-may-bend", "degraded",
        "nobody says that the parts at joint {joint} are rigid: one that rings by less than its markers show "
        "passes a force as fast, which no claim holds; state rigid = true of them if they are stiff",
        "A joint of parts that ring passes forces that ring, and noise may hide both. Claims allow for "
        "bending at the joint, not for loads faster than those the record shows.",
        "State that the parts are rigid (`rigid = true`), or trust the force below its band alone.",
    ),
)
# fmt: on

GROUPS = {
    "What the recording shows": RECORDING,
    "Noise and innovations": NOISE,
    "Shape of the body": SHAPE,
    "Loads": LOADS,
    "Sensors": SENSORS,
    "Affine bodies and large files": AFFINE,
    "Materials from free flights": IDENTIFIED,
    "Bodies in parts": JOINTS,
}
CATALOGUE = {entry.code: entry for group in GROUPS.values() for entry in group}


def note(code: str, level: Level | None = None, **values: str | float) -> Finding:
    """A finding of the catalogue, in its sentence over some values; level: where it is not the usual one.

    >>> note("markers-on-line", count=3).text
    'the 3 markers lie on a line, and a turn about it is not seen: force only; add a marker off the line'
    """
    entry = CATALOGUE[code]
    plain = {name: v.item() if isinstance(v, np.generic) else v for name, v in values.items()}
    text = entry.sentence.format(**plain).replace("\n", " ")  # files hold a finding a line
    known = {name: v if isinstance(v, str) or np.isfinite(v) else None for name, v in plain.items()}
    return Finding(code, entry.level if level is None else level, known, text)
