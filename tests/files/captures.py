"""One thrown body, and the files that capture software would write of it, by their descriptions."""

import numpy as np

GRAVITY = np.array([0.0, 0.0, -9.81])
MASS = {"nose": 0.1, "left": 0.15, "right": 0.15, "tail": 0.2}
SHAPE = np.array([[0.25, 0, 0.02], [-0.05, 0.2, 0], [-0.05, -0.2, 0], [-0.05, 0, -0.01]])
RATE = 200.0


class Throw:
    """A body that spins about z at 4 rad/s and is pushed: its frames, and the force on it."""

    def __init__(self, n=120, seed=0, noise=2e-4):
        self.time = np.arange(n) / RATE
        t, w = self.time, 12.0
        self.names, self.mass = tuple(MASS), np.array(list(MASS.values()))
        offset = SHAPE - self.mass @ SHAPE / self.mass.sum()
        self.center = np.stack([2 * t, 0.3 * np.sin(w * t), 1.2 + 2 * t - 1.5 * t**2], 1)
        acceleration = np.stack([0 * t, -0.3 * w**2 * np.sin(w * t), -3.0 + 0 * t], 1)
        self.force = self.mass.sum() * (acceleration - GRAVITY)
        half = 2.0 * t
        self.quaternion = np.stack([0 * t, 0 * t, np.sin(half), np.cos(half)], 1)
        c, s = np.cos(4 * t), np.sin(4 * t)
        turned = np.stack(
            [
                c[:, None] * offset[:, 0] - s[:, None] * offset[:, 1],
                s[:, None] * offset[:, 0] + c[:, None] * offset[:, 1],
                np.broadcast_to(offset[:, 2], (n, 4)),
            ],
            -1,
        )
        rng = np.random.default_rng(seed)
        self.position = self.center[:, None] + turned + noise * rng.standard_normal((n, 4, 3))
        self.inertia = np.diag([2e-3, 3e-3, 4e-3])


def y_up(vectors):
    """Vectors with z up as a frame with y up has them."""
    return np.stack([vectors[..., 0], vectors[..., 2], -vectors[..., 1]], -1)


def cell(value, digits=6):
    return "" if np.isnan(value) else f"{value:.{digits}f}"


def vicon(path, throw, subject="bird:", devices=True, separator=",", decimal="."):
    """Nexus: a section of devices at 1000 Hz, then trajectories in mm, frames from one."""
    out = []
    if devices:
        out += ["Devices", "1000", ",,Plate 1 - Force,,,Plate 1 - CoP,,", "Frame,Sub Frame,Fx,Fy,Fz,Cx,Cy,Cz"]
        out += [",,N,N,N,mm,mm,mm", *(f"{1 + k // 5},{k % 5},0,0,{k},1,2,0" for k in range(50)), ""]
    out += ["Trajectories", f"{RATE:g}", ",," + ",".join(f"{subject}{n},," for n in throw.names)]
    out += ["Frame,Sub Frame" + ",X,Y,Z" * 4, "," + ",mm" * 12]
    for k, frame in enumerate(1000 * throw.position):
        out.append(f"{k + 1},0," + ",".join(cell(v, 4) for v in frame.ravel()))
    text = "\n".join(out).replace(",", separator).replace(".", decimal)
    path.write_text(text + "\n", encoding="utf-8-sig")
    return path


def tracker(path, throw):
    """Vicon Tracker: objects with quaternion and place."""
    out = ["Objects", f"{RATE:g}", ",,Global Angle (Quaternion) bird:bird,,,,,,"]
    out += ["Frame,Sub Frame,RX,RY,RZ,RW,TX,TY,TZ", ",,,,,,mm,mm,mm"]
    for k, (q, c) in enumerate(zip(throw.quaternion, 1000 * throw.center, strict=True)):
        out.append(f"{k + 1},0," + ",".join(f"{v:.8f}" for v in (*q, *c)))
    path.write_text("\n".join(out) + "\n")
    return path


def motive(path, throw, form="1.23", markers=True, body=True, rotation="Quaternion"):
    """Motive: y up, meters; a rigid body, where it has its markers, the markers and one that is unlabeled."""
    columns = []
    place, turn = y_up(throw.center), throw.quaternion[:, [0, 2, 1, 3]] * [1, 1, -1, 1]
    if body:
        columns += [("Rigid Body", "bird", "01", "Rotation", a, turn[:, k]) for k, a in enumerate("XYZW")]
        columns += [("Rigid Body", "bird", "01", "Position", a, place[:, k]) for k, a in enumerate("XYZ")]
        columns += [("Rigid Body", "bird", "01", "Mean Marker Error", "", 1e-4 + 0 * throw.time)]
        columns += [("Rigid Body Marker", "bird:nose", "02", "Position", a, place[:, k] + 0.1)
                    for k, a in enumerate("XYZ")]  # fmt: skip
        columns += [("Rigid Body Marker", "bird:nose", "02", "Marker Quality", "", 1 + 0 * throw.time)]
    tracks = y_up(throw.position)
    if markers:
        for n, name in enumerate(throw.names):
            columns += [("Marker", f"bird:{name}", f"1{n}", "Position", a, tracks[:, n, k])
                        for k, a in enumerate("XYZ")]  # fmt: skip
        columns += [("Marker", "Unlabeled 1234", "99", "Position", a, np.full(len(throw.time), np.nan))
                    for a in "XYZ"]  # fmt: skip
    meta = ["Format Version", form, "Take Name", "Take 1", "Capture Frame Rate", f"{RATE:.6f}",
            "Total Exported Frames", str(len(throw.time)), "Rotation Type", rotation,
            "Length Units", "Meters", "Coordinate Space", "Global"]  # fmt: skip
    named = ["Type", "Name", "ID", "", ""] if form > "1.2" else ["", "", "", "", ""]
    out = [",".join(meta), ""]
    for label, part in zip(named[:3], range(3), strict=True):
        out.append(f",{label}," + ",".join(column[part] for column in columns))
    if form > "1.24":
        out.append(",Parent," + "," * (len(columns) - 1))
    out.append(",," + ",".join(column[3] for column in columns))
    out.append("Frame,Time (Seconds)," + ",".join(column[4] for column in columns))
    for k, t in enumerate(throw.time):
        out.append(f"{k},{t:.6f}," + ",".join(cell(column[5][k], 7) for column in columns))
    path.write_text("\n".join(out) + "\n")
    return path


def qualisys_6d(path, throw):
    """QTM, version 2: bodies with angles and, column by column, the matrix from body to world."""
    n = len(throw.time)
    out = ["FILE_VERSION\t2.0.0", f"NO_OF_FRAMES\t{n}", "NO_OF_CAMERAS\t4", "NO_OF_BODIES\t1",
           f"FREQUENCY\t{RATE:g}", "NO_OF_ANALOG\t0", "ANALOG_FREQUENCY\t0", "DESCRIPTION\t--",
           "TIME_STAMP\t2024-05-01, 12:00:00\t1234.5", "DATA_INCLUDED\t6D", "BODY_NAMES\tbird"]  # fmt: skip
    columns = ["X", "Y", "Z", "Roll", "Pitch", "Yaw", "Residual", *(f"Rot[{k}]" for k in range(9))]
    out.append("\t".join(["Frame", "Time", "bird " + columns[0], *columns[1:]]))
    for k, t in enumerate(throw.time):
        c, s = np.cos(4 * t), np.sin(4 * t)
        yaw = np.degrees(np.arctan2(s, c))
        values = [*1000 * throw.center[k], 0.0, 0.0, yaw, 0.3, c, s, 0, -s, c, 0, 0, 0, 1]
        out.append("\t".join([str(k + 1), f"{t:.5f}", *(f"{v:.7f}" for v in values)]))
    path.write_text("\n".join(out) + "\n")
    return path


def qualisys(path, throw, header=True, clock=True, lost="0.000", version=False):
    """QTM: millimeters, lost markers at zero or blank."""
    n = len(throw.time)
    out = ["FILE_VERSION\t2.0.0"] if version else []
    out += [f"NO_OF_FRAMES\t{n}", "NO_OF_CAMERAS\t8", f"NO_OF_MARKERS\t{len(throw.names)}",
           f"FREQUENCY\t{RATE:g}", "NO_OF_ANALOG\t0", "ANALOG_FREQUENCY\t0", "DESCRIPTION\t--",
           "TIME_STAMP\t2024-05-01, 12:00:00.000\t1234.5", "DATA_INCLUDED\t3D",
           "EVENT\tthrown\t12\t0.055", "MARKER_NAMES\t" + "\t".join(throw.names),
           "TRAJECTORY_TYPES" + "\tMeasured" * len(throw.names)]  # fmt: skip
    if header:
        columns = "\t".join(f"{m} {a}" for m in throw.names for a in "XYZ")
        out.append(("Frame\tTime\t" if clock else "") + columns)
    for k, frame in enumerate(1000 * throw.position):
        lead = f"{k + 1}\t{throw.time[k]:.5f}\t" if clock else ""
        out.append(lead + "\t".join(lost if np.isnan(v) else f"{v:.3f}" for v in frame.ravel()))
    path.write_text("\n".join(out) + "\n")
    return path


def ros(path, throw, kind="rostopic"):
    """PoseStamped as rostopic, bagpy and PlotJuggler write it, and an Odometry."""
    start = 1_700_000_000_123_456_789
    stamps = [start + round(1e9 * t) for t in throw.time]
    dot = {"rostopic": "field.", "bagpy": "", "plotjuggler": "/bird/pose/", "odometry": "field.pose."}[kind]
    sep = "/" if kind == "plotjuggler" else "."
    names = [f"{dot}pose{sep}position{sep}{a}" for a in "xyz"]
    names += [f"{dot}pose{sep}orientation{sep}{a}" for a in "xyzw"]
    clock = {
        "rostopic": ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"],
        "odometry": ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"],
        "bagpy": ["Time", "header.seq", "header.stamp.secs", "header.stamp.nsecs", "header.frame_id"],
        "plotjuggler": ["__time"],
    }[kind]
    extra = ["field.twist.twist.linear.x"] if kind == "odometry" else []
    out = [",".join([*clock, *names, *extra])]
    for k, stamp in enumerate(stamps):
        lead = {
            "bagpy": [f"{stamp / 1e9:.6f}", k, stamp // 10**9, stamp % 10**9, "world"],
            "plotjuggler": [f"{stamp / 1e9:.9f}"],
        }.get(kind, [stamp, k, stamp, "world"])
        values = [f"{v:.9f}" for v in (*throw.center[k], *throw.quaternion[k])]
        out.append(",".join([*map(str, lead), *values, *(["0.5"] if extra else [])]))
    path.write_text("\n".join(out) + "\n")
    return path


def opencap(path, throw, units="m"):
    """TRC as OpenCap writes it: y up, a line of axes and an empty one, tabs at the ends of lines."""
    factor = {"m": 1.0, "mm": 1000.0}[units]
    out = [f"PathFileType\t4\t(X/Y/Z)\t{path.name}\t",
           "DataRate\tCameraRate\tNumFrames\tNumMarkers\tUnits\tOrigDataRate\tOrigDataStartFrame\tOrigNumFrames\t",
           f"{RATE:.1f}\t{RATE:.1f}\t{len(throw.time)}\t4\t{units}\t{RATE:.1f}\t1\t{len(throw.time)}\t",
           "Frame#\tTime\t" + "\t\t\t".join(throw.names) + "\t\t\t",
           "\t\t" + "\t".join(f"X{k}\tY{k}\tZ{k}" for k in range(1, 5)) + "\t", ""]  # fmt: skip
    for k, frame in enumerate(factor * y_up(throw.position)):
        row = "\t".join("" if np.isnan(v) else f"{v:.8f}" for v in frame.ravel())
        out.append(f"{k + 1}\t{throw.time[k]:.8f}\t{row}\t")
    path.write_text("\n".join(out) + "\n")
    return path


def sto(path, throw, triples=True):
    """STO as OpenSim 4 writes a table: of triples with units, or of plain columns."""
    out = ["DataRate=200.000000", "Units=mm"] if triples else []
    out += [f"DataType={'Vec3' if triples else 'double'}", "version=3", "OpenSimVersion=4.5", "endheader"]
    names = list(throw.names) if triples else [f"{n}_{a}" for n in throw.names for a in "xyz"]
    out.append("\t".join(["time", *names]))
    for t, frame in zip(throw.time, throw.position, strict=True):
        rows = [",".join(repr(float(1000 * v)) for v in point) for point in frame]
        plain = [repr(float(v)) for v in frame.ravel()]
        out.append("\t".join([repr(float(t)), *(rows if triples else plain)]))
    path.write_text("\n".join(out) + "\n")
    return path
