# %% [markdown]
# # Your own data
#
# You have a table of marker tracks, from whatever software your cameras came with. How do you get from
# there to a force that you can defend, and what happens if you get something wrong on the way?

# %%
# %matplotlib inline
from contextlib import chdir, redirect_stderr, redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory
from textwrap import fill

import numpy as np
from matplotlib.figure import Figure

import forceid
from forceid.cli.app import main
from forceid.scenes.recipe import SceneRecipe, simulate

BLUE, VERMILION = "#0072B2", "#D55E00"
holder = TemporaryDirectory()
folder = Path(holder.name)


def run(line, rows=None):
    """What `forceid ...` says in a terminal, within the folder; its first `rows` are shown."""
    with chdir(folder), redirect_stdout(StringIO()) as said, redirect_stderr(said):
        code = main(line.split())
    text = [f"$ forceid {line}", *said.getvalue().splitlines()[:rows], *["..."] * (rows is not None)]
    text = [fill(row, 92) if "error:" in row else row for row in text]
    print(*text, f"[exit code {code}]\n", sep="\n")
    return code, " ".join(" ".join(text).split())


# %% [markdown]
# ## The table
#
# Here it is made: a ring of 130 g with six markers is thrown with three turns a second, pushed by a
# changing force of about 1 N, and filmed at 250 Hz. The table has what such tables have. Lengths are in
# millimeters, though no word says so; single markers are missing now and then; one is hidden for a fifth of
# a second. A gap is an empty cell.

# %%
recipe = SceneRecipe(
    scene="spinner", duration=1.0, sample_rate=250, noise_std=3e-4, seed=4, dropout_fraction=0.03,
    dropout=[{"node": "marker_3", "from": 0.4, "to": 0.6}], parameters={"spin": 3.0, "axial_moment": 0.02},
)  # fmt: skip
filmed = simulate(recipe)
names, seen = filmed.body.node, filmed.motion.position
rows = [",".join(["t", *(f"{name} {axis}" for name in names for axis in "xyz")])]
for t, frame in zip(filmed.motion.time, 1e3 * seen, strict=True):
    rows.append(",".join([f"{t:.4f}", *("" if np.isnan(x) else f"{x:.3f}" for x in frame.ravel())]))
(folder / "throw.csv").write_text("\n".join(rows))
print("\n".join(row[:100] + " ..." for row in rows[:4]))

table_figure = Figure(figsize=(9, 3.2), layout="constrained")
heights, gaps = table_figure.subplots(1, 2, width_ratios=(1.2, 1))
for n, color in ((0, BLUE), (2, VERMILION)):
    heights.plot(filmed.motion.time, 1e3 * seen[:, n, 0], ".", ms=3, color=color, label=names[n])
heights.set(xlabel="time (s)", ylabel="x as in the table (mm)", title="Two of six tracks")
heights.legend(fontsize=8)
for n in range(len(names)):
    lost = filmed.motion.time[np.isnan(seen[:, n, 0])]
    gaps.plot(lost, np.full(len(lost), n), "|", ms=12, color=VERMILION)
gaps.set(xlabel="time (s)", yticks=range(6), yticklabels=names, xlim=(0, 1), ylim=(5.6, -0.6))
gaps.set_title("What is missing")
table_figure

# %% [markdown]
# ## Say what the table does not
#
# A table knows nothing of mass, gravity and units, and forceid assumes none of them. A short file says
# which column is what. What is wrong in it is told in a line: what was found, what was expected, and the
# next step.

# %%
position = "\n".join(f'position.{name} = ["{name} x", "{name} y", "{name} z"]' for name in names)
mass = "\n".join(f"mass.{name} = {0.13 / 6:.5f}" for name in names)
shape = "\n".join(
    f"position.{name} = [{x:.4f}, {y:.4f}, {z:.4f}]"
    for name, (x, y, z) in zip(names, filmed.body.position + 0.0, strict=True)
)


def configure(gravity="gravity = [0.0, 0.0, -9.81]", time="t", units="", body=f"{mass}\n{shape}"):
    table = f'[import.csv]\ntime = "{time}"\n{units}\n{position}\n'
    text = f"[import]\n{gravity}\n\n{table}\n[import.body]\n{body}\n"
    (folder / "throw.toml").write_text(text)
    return text


to_motion = "import throw.csv -o throw.h5 -c throw.toml"
configure(gravity="")
assert run(to_motion)[0] == 2
configure(time="time")
code, said = run(to_motion)
assert code == 3
assert "did you mean 't'" in said
configure()
assert run(to_motion)[0] == 0
code, said = run("inspect throw.h5")
assert code == 3
assert "check the units" in said

# %% [markdown]
# The last one is the millimeters. They show because the body is known in meters: its reference shape says
# how far apart the markers are. Without a shape the first frame would be taken for it, and nothing would
# contradict a ring of 600 m. `inspect` tells what it found; noise of a third of a meter should make you
# look twice.

# %%
configure(body=mass)
assert run(to_motion)[0] == 0
code, said = run("inspect throw.h5", rows=4)
assert "noise position 0.31 m" in said

# %% [markdown]
# Here is the whole file that is right, and what there is to see in the motion before anything is estimated.

# %%
print(configure(units='units.position = "mm"'))
assert run(to_motion)[0] == 0
assert run("inspect throw.h5")[0] == 0

# %% [markdown]
# ## Estimate, and read the verdict first
#
# `ok` says that nothing was found that would speak against the numbers. They come with their standard
# deviations; gaps stay gaps: nothing is filled in, a frame counts for the markers that it shows.

# %%
motion = forceid.open_motion(folder / "throw.h5")
result = forceid.estimate(motion)
estimate = result["estimate"]
print(estimate.attrs["verdict"], "-", estimate.attrs["model_choice"])
print(f"noise {1e3 * float(estimate.attrs['tuned_noise_std_position']):.3f} mm, found in the tracks")
assert estimate.attrs["verdict"] == "ok"

wrench_figure = forceid.plot_wrench(result, filmed.truth)
wrench_figure

# %% [markdown]
# This time the truth is known, and the claim can be checked: the error of the force, ends included, is
# within a third or so of what the estimate says of itself.

# %%
error = estimate.force.values - filmed.truth["force"]
rms, claimed = (float(np.sqrt(np.mean(values**2))) for values in (error, estimate.force_std.values))
print(f"force error {rms:.4f} N rms per axis, claimed {claimed:.4f} N")
assert rms < 0.0075
assert 0.5 < rms / claimed < 1.5
assert abs(float(estimate.attrs["tuned_noise_std_position"]) / 3e-4 - 1) < 0.1

# %% [markdown]
# ## Keep it
#
# The result is one file, with the settings and the hash of what it was made from; the report is one page
# that needs no network. In a notebook `forceid.show_report(result)` shows the same page in place.

# %%
assert run("estimate throw.h5 -o throw.result.h5")[0] == 0
assert run("report throw.result.h5")[0] == 0
print(*sorted(f"{path.name}: {path.stat().st_size / 1024:.0f} KiB" for path in folder.iterdir()), sep="\n")
assert "</html>" in (folder / "throw.result.html").read_text(encoding="utf-8")
