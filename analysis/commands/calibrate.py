"""`seamlog calibrate`: photos of boards, rulers and known points to calibration files."""

import re
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from seamlog.command import command, force_option, group, output_option
from seamlog.errors import CalibrationError, EvidenceError, UsageError
from seamlog.outcome import Outcome

if TYPE_CHECKING:
    from seamlog.analysis.bead.image import Photo
    from seamlog.analysis.calibration.board import Board
    from seamlog.calibration import AnyCalibration, LensCalibration, PlaneCalibration

_SIZE = re.compile(r"(\d+)[xX](\d+)")


@group("calibrate")
def calibrate() -> None:
    """Make a calibration: millimetres instead of pixels."""


def _board_options(function: Any) -> Any:
    options = (
        click.option(
            "--board",
            "kind",
            type=click.Choice(["chessboard", "charuco"]),
            default="chessboard",
            show_default=True,
        ),
        click.option(
            "--squares", required=True, metavar="CxR", help="Squares across and down, such as 10x7."
        ),
        click.option("--square-mm", type=float, required=True, help="Side of a square, measured."),
        click.option("--marker-mm", type=float, help="Side of a ChArUco board's marker."),
        click.option("--dictionary", default="DICT_4X4_50", show_default=True),
    )
    for option in reversed(options):
        function = option(function)
    return function


def _file_option(required: bool = False) -> Callable[[Any], Any]:
    return output_option(
        "Calibration file; default: <photo>.calibration.json beside it.", required=required
    )


@command("camera")
@click.argument("photos", nargs=-1, required=True, type=click.Path(path_type=Path))
@_board_options
@_file_option(required=True)
@force_option
def camera(
    photos: tuple[Path, ...],
    kind: str,
    squares: str,
    square_mm: float,
    marker_mm: float | None,
    dictionary: str,
    output: Path,
    force: bool,
) -> Outcome:
    """Find a camera's lens from PHOTOs of a board, tilted to all sides.

    The file has no millimetres: give it to `calibrate plane --lens`.
    """
    from seamlog.analysis.bead.image import load_photo
    from seamlog.analysis.calibration.board import find_board
    from seamlog.analysis.calibration.camera import calibrate_camera

    _check_free(output, force)
    board = _board(kind, squares, square_mm, marker_mm, dictionary)
    views, left_out, size = [], [], None
    for path in photos:
        photo = load_photo(path)
        size = size or (photo.width_px, photo.height_px)
        if (photo.width_px, photo.height_px) != size:
            raise CalibrationError(
                f"{path} has {photo.width_px} x {photo.height_px} px, {photos[0]} {size[0]} x "
                f"{size[1]} px; take all photos with one camera and setting"
            )
        try:
            views.append(find_board(photo.pixels, board, str(path)))
        except EvidenceError as error:
            left_out.append(str(error))
    assert size is not None
    found = calibrate_camera(views, size, _date(photos[0]))
    told = f"{found.photos} of {len(photos)} photos, residual {found.residual_px:.3f} px"
    return _written("camera", found, output, [told, *(f"left out: {text}" for text in left_out)])


@command("plane")
@click.argument("photo", type=click.Path(path_type=Path))
@_board_options
@click.option("--lens", type=click.Path(path_type=Path), help="Lens from `calibrate camera`.")
@click.option(
    "--thickness-mm", type=float, default=0.0, help="Height of the board's face above the plate."
)
@click.option("--distance-mm", type=float, help="From camera to board, where there is no --lens.")
@click.option(
    "--square-u-mm", type=float, default=0.0, help="Standard uncertainty of a square's side."
)
@click.option(
    "--height-u-mm",
    type=float,
    default=0.2,
    show_default=True,
    help="How well the plane is that of the bead's toes.",
)
@_file_option()
@force_option
def plane(
    photo: Path,
    kind: str,
    squares: str,
    square_mm: float,
    marker_mm: float | None,
    dictionary: str,
    lens: Path | None,
    thickness_mm: float,
    distance_mm: float | None,
    square_u_mm: float,
    height_u_mm: float,
    output: Path | None,
    force: bool,
) -> Outcome:
    """Find the plane of the plate from a PHOTO with a board lying on it.

    Without --lens the lens's distortion is found in the same photo.
    """
    from seamlog.analysis.bead.image import load_photo
    from seamlog.analysis.calibration.plane import Placing, calibrate_plane

    target = output or _beside(photo)
    _check_free(target, force)
    if min(thickness_mm, square_u_mm, height_u_mm, distance_mm or 0.0) < 0:
        raise UsageError("thickness, distance and uncertainties cannot be negative")
    board = _board(kind, squares, square_mm, marker_mm, dictionary)
    taken = load_photo(photo)
    placing = Placing(thickness_mm, distance_mm, square_u_mm, height_u_mm)
    found = calibrate_plane(taken.pixels, board, placing, _lens(lens), str(photo), _date(photo))
    return _written("plane", found, target, _plane_lines(found, taken))


@command("scale")
@click.argument("photo", type=click.Path(path_type=Path))
@click.option(
    "--length",
    "lengths",
    type=float,
    nargs=5,
    multiple=True,
    metavar="MM X1 Y1 X2 Y2",
    help="A known length between two points of the photo; several show the tilt.",
)
@click.option(
    "--ruler",
    "rulers",
    type=float,
    nargs=5,
    multiple=True,
    metavar="MM X1 Y1 X2 Y2",
    help="A line across the ticks of a ruler, MM apart, which are counted.",
)
@click.option(
    "--beside-bead", is_flag=True, help="The length lies in the bead's plane right beside it."
)
@_file_option()
@force_option
def scale(
    photo: Path,
    lengths: tuple[tuple[float, ...], ...],
    rulers: tuple[tuple[float, ...], ...],
    beside_bead: bool,
    output: Path | None,
    force: bool,
) -> Outcome:
    """Find the scale of a PHOTO from known lengths or rulers in it: the weaker kind.

    One length holds on its own line only (4 % elsewhere); lengths on both sides of the bead show
    the tilt.
    """
    import numpy as np

    from seamlog.analysis.bead.image import load_photo
    from seamlog.analysis.calibration.ruler import read_ruler
    from seamlog.analysis.calibration.scale import KnownLength, calibrate_scale

    target = output or _beside(photo)
    _check_free(target, force)
    taken = load_photo(photo)
    known = [KnownLength(mm, (x1, y1), (x2, y2)) for mm, x1, y1, x2, y2 in lengths]
    for mm, x1, y1, x2, y2 in rulers:
        if mm <= 0:
            raise UsageError(f"ticks {mm:g} mm apart cannot be")
        known += read_ruler(taken.pixels, mm, np.array([x1, y1]), np.array([x2, y2]), str(photo))
    size = (taken.width_px, taken.height_px)
    found = calibrate_scale(known, size, beside_bead, str(photo), _date(photo))
    read = [f"{item.mm:.2f} mm on {item.px:.1f} px" for item in known]
    return _written("scale", found, target, [*read, _u_line(found.scale_relative_u)])


@command("table")
@click.argument("photo", type=click.Path(path_type=Path))
@click.option(
    "--calibration",
    type=click.Path(path_type=Path),
    help="Plane of the photo; default: <photo>.calibration.json beside it.",
)
@click.option(
    "--point",
    "points",
    type=float,
    nargs=4,
    multiple=True,
    required=True,
    metavar="X_PX Y_PX X_MM Y_MM",
    help="A point of the photo and its place in the table frame; two or more.",
)
@click.option(
    "--table-at-mm", type=float, default=0.0, help="Table position when the photo was taken."
)
@output_option("Calibration file in the table frame.")
@force_option
def table(
    photo: Path,
    calibration: Path | None,
    points: tuple[tuple[float, ...], ...],
    table_at_mm: float,
    output: Path,
    force: bool,
) -> Outcome:
    """Tie the plane of a PHOTO to the table by points of known place.

    A bead on such a photo needs no --start to be joined with the log.
    """
    import numpy as np

    from seamlog.analysis.bead.image import load_photo
    from seamlog.analysis.bead.plane import plane_of
    from seamlog.analysis.calibration.table import calibrate_table
    from seamlog.calibration import PlaneCalibration, load_calibration

    _check_free(output, force)
    given = load_calibration(calibration or _beside(photo))
    if not isinstance(given, PlaneCalibration):
        raise UsageError("a scale has no plane; make one with 'seamlog calibrate plane'")
    plane_of(load_photo(photo), given)
    known = np.array(points, dtype=np.float64)
    fit = calibrate_table(given, known[:, :2], known[:, 2:], table_at_mm)
    misses = ", ".join(f"{miss:.2f}" for miss in fit.misses_mm)
    return _written("table", fit.calibration, output, [f"points miss their places by {misses} mm"])


@command("laser")
@click.argument("photo", type=click.Path(path_type=Path))
@click.option(
    "--point",
    "points",
    type=float,
    nargs=4,
    multiple=True,
    required=True,
    metavar="X_PX Y_PX X_MM Z_MM",
    help="A point of the stripe: its place across the seam and its height; four or more.",
)
@click.option("--lens", type=click.Path(path_type=Path), help="Lens from `calibrate camera`.")
@output_option("Calibration file; attach it as laser_from_camera.json.")
@force_option
def laser(
    photo: Path, points: tuple[tuple[float, ...], ...], lens: Path | None, output: Path, force: bool
) -> Outcome:
    """Find a laser's light plane from points of known height in a frame of its camera (PHOTO).

    Lay steps or gauge blocks under the stripe and name the stripe's corners on them.
    """
    import numpy as np

    from seamlog.analysis.bead.image import load_photo
    from seamlog.analysis.calibration.laser import calibrate_laser

    _check_free(output, force)
    taken = load_photo(photo)
    known = np.array(points, dtype=np.float64)
    given = _lens(lens)
    size = (taken.width_px, taken.height_px)
    found = calibrate_laser(
        known[:, :2], known[:, 2:], size, given.lens if given else None, _date(photo)
    )
    return _written("laser", found, output, [found.source, _u_line(found.scale_relative_u)])


for _act in (camera, plane, scale, table, laser):
    calibrate.add_command(_act)


def _board(
    kind: str, squares: str, square_mm: float, marker_mm: float | None, dictionary: str
) -> "Board":
    from seamlog.analysis.calibration.board import Board

    size = _SIZE.fullmatch(squares.strip())
    if size is None:
        raise UsageError(f"--squares {squares!r}: write it as 10x7, squares across and down")
    if kind == "charuco" and marker_mm is None:
        raise UsageError("a ChArUco board needs --marker-mm, the side of its markers")
    marker = marker_mm if kind == "charuco" else None
    return Board(int(size[1]), int(size[2]), square_mm, marker, dictionary)


def _lens(path: Path | None) -> "LensCalibration | None":
    from seamlog.calibration import LensCalibration, parse_any_calibration

    if path is None:
        return None
    found = parse_any_calibration(path.read_bytes(), str(path))
    if not isinstance(found, LensCalibration):
        raise CalibrationError(f"{path} is no lens; make one with 'seamlog calibrate camera'")
    return found


def _beside(photo: Path) -> Path:
    return photo.with_name(photo.stem + ".calibration.json")


def _check_free(path: Path, force: bool) -> None:
    from seamlog.files import check_output

    check_output(path, force)


def _date(photo: Path) -> str:
    """Day of the photo's file: the calibration's age counts from there."""
    return datetime.fromtimestamp(photo.stat().st_mtime, UTC).date().isoformat()


def _plane_lines(found: "PlaneCalibration", photo: "Photo") -> list[str]:
    from seamlog.analysis.calibration.plane import mm_per_px

    scale = mm_per_px(found.matrix(), (photo.width_px, photo.height_px))
    return [
        f"{scale:.5g} mm per px in the middle",
        f"corners miss by {1e3 * found.residual_mm:.2g} um rms",
        _u_line(found.scale_relative_u),
        found.source,
    ]


def _u_line(relative_u: float) -> str:
    return f"lengths known to {100 * relative_u:.2g} % (standard uncertainty)"


def _written(act: str, found: "AnyCalibration", path: Path, lines: list[str]) -> Outcome:
    from seamlog.files import write_bytes

    text = found.model_dump_json(by_alias=True, indent=1) + "\n"
    write_bytes(path, text.encode())
    document = {"file": str(path), "calibration": found.model_dump(mode="json", by_alias=True)}
    return Outcome(f"seamlog.calibrate.{act}", "\n".join([str(path), *lines]), document)
