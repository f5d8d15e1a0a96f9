"""Rigid bodies out of URDF, SDF and OpenSim files and printed mass properties: the body that was written."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from forceid.errors import ConfigError, DataError
from forceid.files.formats.bodies.body_file import body_of
from forceid.files.formats.bodies.cad_text import cad_body, unit
from forceid.files.formats.bodies.mass_properties import LARGEST
from forceid.files.formats.sources import import_sources
from forceid.import_settings import BodySetting, ImportSettings
from forceid.sections import validate

SIX = ((0, 0), (1, 1), (2, 2), (0, 1), (0, 2), (1, 2))
LETTERS = "xyz"


def drawn(seed):
    """Mass, center and inertia about it of twelve point masses somewhere."""
    rng = np.random.default_rng(seed)
    m, x = rng.uniform(0.05, 0.3, 12), rng.uniform(-0.2, 0.2, (12, 3)) + rng.uniform(-0.3, 0.3, 3)
    center = m @ x / m.sum()
    off = x - center
    return m.sum(), center, (off**2).sum(1) @ m * np.eye(3) - np.einsum("n,na,nb->ab", m, off, off)


def entries(J, pattern, between=" "):
    return between.join(
        pattern.format(ij=LETTERS[i] + LETTERS[j], v=f"{J[i, j]:.15g}", ji=LETTERS[j] + LETTERS[i])
        for i, j in SIX
    )


def urdf(path, seed, rpy=(0.3, -0.7, 1.9)):
    m, c, J = drawn(seed)
    R = Rotation.from_euler(
        "ZYX", rpy[::-1]
    ).as_matrix()  # roll about x, then pitch and yaw, about fixed axes
    inner = entries(R.T @ J @ R, 'i{ij}="{v}"')
    xyz, turn = (" ".join(f"{v:.15g}" for v in values) for values in (c, rpy))
    path.write_text(
        f'<robot name="r"><link name="world"/><link name="arm"><inertial><origin xyz="{xyz}" rpy="{turn}"/>'
        f'<mass value="{m:.15g}"/><inertia {inner}/></inertial></link></robot>'
    )
    return path


def sdf(path, seed, rpy=(0.3, -0.7, 1.9), degrees=False):
    m, c, J = drawn(seed)
    R = Rotation.from_euler("ZYX", rpy[::-1]).as_matrix()
    inner = entries(R.T @ J @ R, "<i{ij}>{v}</i{ij}>")
    pose = " ".join(f"{v:.15g}" for v in [*c, *(np.degrees(rpy) if degrees else rpy)])
    told = ' degrees="true"' if degrees else ""
    path.write_text(
        f'<?xml version="1.0"?><sdf version="1.9"><model name="car"><link name="arm"><inertial>'
        f"<pose{told}>{pose}</pose><mass>{m:.15g}</mass><inertia>{inner}</inertia></inertial></link></model></sdf>"
    )
    return path


def osim(path, seed, old=False):
    m, c, J = drawn(seed)
    inner = entries(J, "<inertia_{ij}>{v}</inertia_{ij}>" if old else "{v}")
    inner = inner if old else f"<inertia>{inner}</inertia>"
    place = "<body>arm</body>" if old else "<socket_parent_frame>/bodyset/arm</socket_parent_frame>"
    path.write_text(
        f'<OpenSimDocument Version="40000"><Model name="m"><BodySet><objects><Body name="arm">'
        f"<mass>{m:.15g}</mass>"
        f"<mass_center>{' '.join(f'{v:.15g}' for v in c)}</mass_center>{inner}</Body></objects></BodySet>"
        f'<MarkerSet><objects><Marker name="tip">{place}<location>0.1 0.2 0.3</location></Marker></objects>'
        "</MarkerSet></Model></OpenSimDocument>"
    )
    return path


def printed_table(J, letter, sign):
    """Rows of an inertia as a program prints it: products by sign."""
    off = np.where(np.eye(3, dtype=bool), J, sign * J)
    names = [
        [f"{letter}{a}{b} = {off[i, j]:.6f}" for j, b in enumerate(LETTERS)] for i, a in enumerate(LETTERS)
    ]
    return "\n".join("\t" + "\t".join(row) for row in names)


def solidworks(seed, origin=True, axes=True, products=True):
    """Grams and millimeters, products as integrals."""
    m, c, J = drawn(seed)
    c, J, m = 1e3 * c, 1e9 * J, 1e3 * m
    J = J if products else np.diag(np.diag(J))
    P, A = np.linalg.eigh(J)
    text = (
        "Mass properties of arm\n     Configuration: Default\n     Coordinate system: -- default --\n\n"
        f"Mass = {m:.5f} grams\n\nVolume = 8000.00 cubic millimeters\n\n"
        f"Center of mass: ( millimeters )\n\tX = {c[0]:.6f}\n\tY = {c[1]:.6f}\n\tZ = {c[2]:.6f}\n\n"
    )
    if axes:
        text += (
            "Principal axes of inertia and principal moments of inertia: ( grams * square millimeters )\n"
            "Taken at the center of mass.\n"
        )
        for k, a in enumerate(LETTERS):
            row = ", ".join(f"{v:.3f}" for v in A[:, k])
            text += f"\t I{a} = ({row})   \tP{a} = {P[k]:.2f}\n"
    text += (
        "\nMoments of inertia: ( grams * square millimeters )\nTaken at the center of mass and aligned with "
        f"the output coordinate system. (Using positive tensor notation.)\n{printed_table(J, 'L', -1)}\n"
    )
    if origin:
        about = J + m * (c @ c * np.eye(3) - np.outer(c, c))
        text += (
            "\nMoments of inertia: ( grams * square millimeters )\nTaken at the output coordinate system. "
            f"(Using positive tensor notation.)\n{printed_table(about, 'I', -1)}\n"
        )
    return text


def fusion(seed):
    """Products as entries of the tensor; the unit stands behind the heading."""
    m, c, J = drawn(seed)
    c, J, m = 1e3 * c, 1e9 * J, 1e3 * m
    about = J + m * (c @ c * np.eye(3) - np.outer(c, c))
    center = ", ".join(f"{v:.6f} mm" for v in c)
    return (
        f"Physical\n\tMass\t{m:.5f} g\n\tVolume\t8000.00 mm^3\n\tCenter of Mass\t{center}\n"
        f"\tMoment of Inertia at Center of Mass   (g mm^2)\n{printed_table(J, 'I', 1)}\n"
        f"\tMoment of Inertia at Origin   (g mm^2)\n{printed_table(about, 'I', 1)}\n"
    )


def onshape(seed):
    """Units behind every number, the inertia about the center; nothing tells the sign of products."""
    m, c, J = drawn(seed)
    lines = [
        f"Mass: {m:.8f} kg",
        "Center of mass",
        *(f"{a.upper()}: {1e3 * v:.6f} mm" for a, v in zip("xyz", c, strict=True)),
    ]
    lines += [
        "Moments of inertia",
        *(f"L{LETTERS[i]}{LETTERS[j]}: {1e6 * J[i, j]:.5f} kg mm²" for i, j in SIX),
    ]
    return "\n".join(lines) + "\n"


def same(found, seed, rtol=1e-9):
    m, c, J = drawn(seed)
    assert found.mass == pytest.approx(m, rel=rtol)
    assert np.allclose(found.center, c, rtol=0, atol=rtol * 0.3)
    assert np.allclose(found.inertia, J, rtol=0, atol=rtol * np.trace(J))


@pytest.mark.parametrize("seed", range(4))
def test_a_link_is_read_as_it_was_written(tmp_path, seed):
    arm = BodySetting(link="arm")
    same(body_of(urdf(tmp_path / "a.urdf", seed), arm), seed)
    same(body_of(sdf(tmp_path / "a.sdf", seed), arm), seed)
    same(body_of(sdf(tmp_path / "b.sdf", seed, degrees=True), BodySetting(link="car::arm")), seed)
    for old in (False, True):
        found = body_of(osim(tmp_path / "a.osim", seed, old), arm)
        same(found, seed)
        assert found.marker["tip"].tolist() == [0.1, 0.2, 0.3]


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize(
    "text", [solidworks, lambda s: solidworks(s, axes=False), lambda s: solidworks(s, origin=False), fusion]
)
def test_printed_mass_properties_are_read_whichever_sign_products_have(tmp_path, seed, text):
    path = tmp_path / "arm.txt"
    path.write_text(text(seed))
    same(cad_body(path), seed, 1e-6)


def test_products_whose_sign_nothing_tells_are_asked_for(tmp_path):
    path = tmp_path / "arm.txt"
    path.write_text(onshape(0))
    with pytest.raises(DataError, match=r'sign of its products.*products = "integral"'):
        cad_body(path)
    same(cad_body(path, "tensor"), 0, 1e-5)
    path.write_text(solidworks(0, origin=False, axes=False, products=False))
    assert np.allclose(cad_body(path).inertia, np.diag(np.diag(drawn(0)[2])), rtol=1e-5)


@pytest.mark.parametrize(
    ("words", "found"),
    [("( kilograms * square meters )", "kg*m^2"), ("(pounds * square inches)", "lb*in^2"), ("grams", "g"),
     ("g mm^2", "g mm^2")],
)  # fmt: skip
def test_units_in_words_become_powers(words, found):
    assert unit(words) == found


def test_a_measured_pose_of_a_link_is_a_motion_of_its_body(tmp_path):
    urdf(tmp_path / "robot.urdf", 7)
    t = np.arange(60) / 100
    rows = [f"{k:.3f},{k},{0.2 * k},{k**2},0,0,{np.sin(k / 2):.12g},{np.cos(k / 2):.12g}" for k in t]
    (tmp_path / "pose.csv").write_text("\n".join(["t,x,y,z,qx,qy,qz,qw", *rows]) + "\n")
    columns = {"time": "t", "center": ["x", "y", "z"], "orientation": ["qx", "qy", "qz", "qw"]}
    table = {"gravity": [0, 0, -9.81], "csv": columns, "body": {"file": "robot.urdf", "link": "arm"}}
    ((_, made),) = import_sources([tmp_path / "pose.csv"], validate(ImportSettings, table, "test:"))
    m, c, J = drawn(7)
    assert made.body.total_mass == pytest.approx(m)
    assert np.allclose(made.body.mass_center, c)
    assert np.allclose(made.body.inertia, J)
    assert "robot.urdf" in made.source_sha256
    assert 'file = "robot.urdf"' in made.import_settings


BOMB = (
    '<!DOCTYPE robot [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;&a;">]><robot><link name="arm">&b;</link></robot>'
)
LINK = '<robot><link name="arm"><inertial><mass value="{m}"/><inertia {i}/></inertial></link></robot>'
GOOD = entries(np.diag([2.0, 3.0, 4.0]), 'i{ij}="{v}"')


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (BOMB, "DOCTYPE, expected none"),
        ("<robot><link", "is no XML"),
        ("<svg/>", "XML of <svg>, expected <robot>"),
        (
            LINK.format(m="${mass}", i=GOOD),
            r"link arm: mass value is '\$\{mass\}', expected 1 number; run xacro",
        ),
        (LINK.format(m="-1", i=GOOD), "has mass -1 kg, expected more than zero"),
        (LINK.format(m="nan", i=GOOD), "is 'nan', expected 1 number"),
        (LINK.format(m="1", i=GOOD.replace("4", "9")), "principal moments 2, 3, 9 kg m2"),
        (LINK.format(m="1", i=""), "inertia ixx is '', expected 1 number"),
        ('<robot><link name="arm"/></robot>', r"has no <inertial>, expected one in <link>"),
        ("mass is unknown", "has no line of the mass"),
        ("Mass = 3\nCenter of mass: ( m )\nX = 0\nY = 0\nZ = 0\n", "a mass without a unit"),
        ("Mass = 3 kg\n", "has no center of mass"),
        ("Mass = 3 kg\nCenter of mass:\nX = 1\nY = 2\nZ = 3\n", "center of mass without a unit"),
        ("Mass = 3 kg\nCenter of mass: ( m )\nX = 1\nY = 2\nZ = 3\n", "no moments of inertia"),
    ],
)
def test_what_is_wrong_with_a_file_is_one_line(tmp_path, text, said):
    path = tmp_path / "arm.file"
    path.write_text(text)
    with pytest.raises(DataError, match=said) as caught:
        body_of(path, BodySetting(link="arm" if text.startswith("<") else ""))
    assert "\n" not in str(caught.value)
    assert str(path) in str(caught.value)


def test_a_link_that_is_not_there_is_answered_with_the_nearest(tmp_path):
    path = urdf(tmp_path / "a.urdf", 0)
    with pytest.raises(ConfigError, match="none named 'arms'; link = \"arm\""):
        body_of(path, BodySetting(link="arms"))
    with pytest.raises(ConfigError, match=r"has 2 bodies .world, arm., expected link"):
        body_of(path, BodySetting())


def test_a_file_too_large_or_of_another_encoding_is_refused(tmp_path):
    path = tmp_path / "a.urdf"
    path.write_text(BOMB, encoding="utf-16")
    with pytest.raises(DataError, match="is not UTF-8 text"):
        body_of(path, BodySetting())
    with open(path, "wb") as f:
        f.truncate(LARGEST + 1)
    with pytest.raises(DataError, match="expected 32 MB at most"):
        body_of(path, BodySetting())


@pytest.mark.parametrize("key", ["mass", "table"])
def test_a_mass_beside_a_file_is_refused(tmp_path, key):
    (tmp_path / "pose.csv").write_text("t,x,y,z\n0,0,0,0\n")
    body = {"file": "a.urdf", key: {"mass": 2.0, "table": "winter"}[key]}
    table = {"gravity": [0, 0, -9.81], "csv": {"time": "t", "center": ["x", "y", "z"]}, "body": body}
    with pytest.raises(ConfigError, match="has file beside a mass of its own"):
        import_sources([tmp_path / "pose.csv"], validate(ImportSettings, table, "test:"))
