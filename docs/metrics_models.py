"""The content of `metrics.json` as pydantic models, from which `make_reference.py` makes the published schema.

Keys end in their unit; a key without one is a number, a share or a name. A later version may add keys.
"""

from __future__ import annotations

from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, Field


class Entry(BaseModel):
    """A part of the file; keys that it does not name are kept."""

    model_config = ConfigDict(extra="allow", use_attribute_docstrings=True, strict=True)


class Distribution(Entry):
    """Values over the cloth; percentiles by area."""

    min: float
    p05: float
    p50: float
    p95: float
    max: float
    mean: float


class Remedy(Entry):
    """A dart or seam that would help a piece to fit."""

    cut: str
    length_m: float
    outside_after: float | None
    """Share of the cloth beyond its limits with the cut."""
    piece: str | None = None
    table: dict[str, Any] | None = None
    """A scene's `[[cuts]]` entry that makes the cut, where one can."""


class PieceWear(Entry):
    """How a piece is strained when worn; strains are shares, shear degrees, tensions N/m, pressures Pa."""

    strain_limit: float
    shear_limit: float | None
    """[degrees]; none of an isotropic sheet, which has no threads: its principal strains count."""
    outside: float
    """Share of the cloth beyond its limits: stretched, slack or sheared; a place counts once."""
    outside_unsewn: float | None = None
    hollow: float
    """Share of the cloth over hollows, where no pressure is known."""
    held: float
    """Share of the cloth that is stretched or sheared beyond a limit where it lies close to the body; at most 1 % is tolerated."""
    slack: float
    """Share of the cloth that lies in folds: longer than the surface by more than the limit."""
    where_not: list[str]
    """Places where it is held, in words."""
    where_slack: list[str]
    """Places where it lies in folds, in words."""
    strain_warp: Distribution
    strain_weft: Distribution
    shear: Distribution
    """Angle by which warp and weft are off the right angle [degrees]."""
    tension_warp: Distribution
    tension_weft: Distribution
    pressure: Distribution
    stretch_warp: float | None = None
    """The stretch of the warp that was asked for."""
    stretch_weft: float | None = None
    would_help: list[Remedy]


class Left(Entry):
    """What a relaxation has left, by estimate."""

    energy_share: float
    """Of the model energy, still to be released."""
    outline_mm: float
    """How far the outline can still move."""


class Stage(Entry):
    """A stage of a piece's history, with the energies at its end."""

    name: str
    """develop, steps (the paper's, with which a relaxation begins), relax, contact, sew, cut:NAME and so on."""
    model_energy_j: float
    """What is minimised: springs and guard, or membrane and guard."""
    guard_energy_j: float
    strain_energy_j: float
    """Eq. (3) of the paper."""
    steps: int
    """Approximate implicit steps, or iterations of L-BFGS."""
    work_units: float
    """All work, in approximate implicit steps over all vertices."""
    seconds: float
    converged: bool
    residual: float | None
    """Largest force on a vertex over the mean spring force; null for develop and steps."""
    left: Left | None
    """Of L-BFGS; null for the paper's steps."""


class CutSeam(Entry):
    """A seam that a cut has made."""

    kind: Literal["dart", "fish-eye", "parting"]
    opening_m: float
    widest_m: float | None = None
    angle_deg: float | None = None
    intake_m: float | None = None
    legs_m: list[float] | None = None
    tip_to_tip_m: float | None = None
    left_seam_m: float
    right_seam_m: float
    drawn: dict[str, Any] | None = None
    """The dart as it is drawn."""


class Cut(Entry):
    """A cut that was made."""

    name: str
    length_m: float
    seams: list[CutSeam]


class LineEnergy(Entry):
    """Strain energy density along a line."""

    length_m: float
    mean_j_per_m2: float
    peak_j_per_m2: float


class EnergyMap(Entry):
    """Where the strain energy is."""

    peak: str
    peak_j_per_m2: float
    lines: dict[str, LineEnergy]
    bricks: dict[str, float] | None = None
    """Strain energy by brick [J]."""


class FormDart(Entry):
    """A dart of a form's piece."""

    name: str
    line: str
    intake_m: float
    legs_m: list[float]
    tip_to_point_m: float | None


class Piece(Entry):
    """A piece of cloth."""

    vertices: int
    faces: int
    springs: int
    flipped_faces: int
    length_error: float
    """Sum of |flat - body| over the edges, by their length on the body."""
    area_error: float
    """Sum of |flat - body| over the faces, by their area on the body."""
    boundary_error: float
    strain_energy_j: float
    model_energy_j: float
    guard_energy_j: float
    contact_energy_j: float
    overlap_m2: float
    """Area of the pattern that lies over itself."""
    area_m2: float
    """Flat area."""
    converged: bool
    fabric: str
    model: Literal["springs", "membrane"]
    datum: str
    development: str
    start: str
    wear: PieceWear
    stages: list[Stage]
    cuts: list[Cut]
    energy: EnergyMap
    opened: dict[str, Any] | None
    """Faces that take up far more of the pattern than of the body."""
    notes: list[str]
    darts: list[FormDart] | None = None


class WearerSide(Entry):
    """A quarter of the trunk, or half of a limb, at one level."""

    ease_m: float
    """By how much its cloth is larger than the body between its seams."""
    pressure_pa: float
    """The highest on it: tension over the radius of a tape around the body."""


class WearerLevel(Entry):
    """How the cloth is around the body at one level."""

    ease_m: float
    """By how much the cloth is larger than the body."""
    strain: float
    """By how much it is stretched around the body; 0 where it is larger."""
    sides: dict[str, WearerSide]


class StretchedPlace(Entry):
    """Where the cloth is stretched most around the body."""

    place: str
    strain: float


class BodyPressure(Entry):
    """Pressure on the wearer where the cloth touches, by its area."""

    p50: float
    p95: float
    max: float
    place: str


class WearerFit(Entry):
    """How a garment fits the body itself, whatever form its pattern was made on."""

    strain_limit: float
    """Of the cloth; no row around the body may be stretched beyond it."""
    levels: dict[str, WearerLevel]
    touching: float
    """Share of the cloth that goes around the body and is stretched there."""
    most_stretched: StretchedPlace | None = None
    pressure_pa: BodyPressure | None = None


class GarmentWear(Entry):
    """How the cloth of all pieces is strained; `verdict` says whether that fits."""

    outside: float
    held: float
    slack: float
    where_not: list[str]
    would_help: list[Remedy]
    against: Literal["form"] | None = None
    """On what strains and pressures of the pieces are measured."""
    wearer: WearerFit | None = None


class Level(Entry):
    """A level of the body."""

    height_m: float
    girth_m: float
    """What a tape reads."""
    section_m: float | None = None
    girth_over_size_m: float | None = None
    height_over_size_m: float | None = None


class Body(Entry):
    """The body of a form."""

    source: str
    notes: list[str]
    levels: dict[str, Level]
    nearest_size: str | None = None
    table: dict[str, Any] | None = None
    """The scene's table of the body, by which `warpflat drape DIR` builds it again."""


class Seam(Entry):
    """A seam of a garment."""

    name: str
    sides: list[str]
    length_mm: list[float]
    """Of its two sides as they are cut: one that ends at a cuff, a band or an opening is without it."""
    length_3d_mm: float
    """Of the whole seam on the form."""
    difference_mm: float
    ease: float
    """How much longer the second side is meant to be, as a share."""
    price_j: float | None


class Girth(Entry):
    """A level's girths with seams and darts closed."""

    body_m: float
    form_m: float
    pattern_m: float
    ease_m: float
    ease_wanted_m: float | None = None


class Ring(Entry):
    """A closed way around the garment, and what of the body must pass through it."""

    name: str
    edge: bool
    """Whether it is an edge of the cloth; otherwise a level within it."""
    length_mm: float
    """Seams and darts closed."""
    stretched_mm: float
    """At the cloth's strain limit."""
    over: str
    girth_mm: float | None
    source: str
    opened_mm: float
    """What openings add."""
    passes: bool | None
    opening_needed_mm: float
    """Depth of the opening through this ring; at a level, how far it must reach beyond it."""


class Constraint(Entry):
    """A constraint and its price."""

    name: str
    kind: str
    price_j: float
    amiss_mm: float
    """What is left of it."""


class Sewing(Entry):
    """The relaxation of the pieces together."""

    converged: bool
    contradictory: bool
    steps: int
    seconds: float
    energy_before_j: float
    energy_after_j: float
    price_j: float
    largest_difference_mm: float


class Drawing(Entry):
    """The drawn pattern."""

    fit_error_mm: float | None = None
    seam_difference_mm: float | None = None
    seam_difference_per_50mm_mm: float | None = None
    seams_that_differ: list[str] | None = None
    not_drawn: str | None = None
    """Why no pattern was drawn."""


class CutPiece(Entry):
    """A piece that is cut from a cloth."""

    piece: str
    title: str
    """As it is printed."""
    quantity: int
    on_fold: bool
    mirrored: int
    """How many of them are cut turned over."""


class ClothCut(Entry):
    """What is cut from one cloth."""

    name: str
    pieces: list[CutPiece]


class Corner(Entry):
    """A place where an edge runs on across a seam or a dart, or meets a fold."""

    place: str
    """The seam, dart or fold, and the edges that run on."""
    size: str
    wanted_deg: float
    """180 across a seam or dart, 90 at a fold."""
    before_deg: float
    """What the pieces' angles made together before truing."""
    after_deg: float
    move_mm: float
    """The largest move of the edges that meet there."""


class DrawnCurve(Entry):
    """A stretch of a form's border, drawn as by hand."""

    place: str
    """The piece and its edge."""
    seam: str
    """The seam that it is a side of, or a part of one; "" for a free edge."""
    book: str
    """Where a book draws it straight: "all", "below hip" or ""."""
    straight: bool
    """Whether it is straight there."""
    away_mm: float
    """How far from straight it was there; beyond the bound it stays curved."""
    inflections_before: int
    inflections_after: int
    """How often it changes from bending one way to bending the other, by a degree or more each, before its corners are trued."""
    shift_mm: float
    """The largest distance between the two shapes, laid upon each other."""
    price_j: float
    """Half the work of the forces that hold it."""


class Curves(Entry):
    """The borders of a form's pieces, drawn as by hand."""

    bound_mm: float
    """`curves_mm` of the scene."""
    price_j: float
    """The model energy that all cost together."""
    lines: list[DrawnCurve]


class WalkedSeam(Entry):
    """The two sides of a seam laid along each other."""

    name: str
    size: str
    difference_mm: float
    """By how much the second side is too long for its ease."""
    notches_mm: float | None
    """Largest distance along the seam from a notch to what it meets."""


class Marker(Entry):
    """The lay plan."""

    width_m: float | None = None
    length_m: float | None = None
    utilisation: float | None = None
    pieces: int | None = None
    garments: int | None = None
    folded: bool | None = None
    """Whether the cloth lies double; the width is that of the half."""
    not_made: str | None = None


class Spread(Entry):
    """Values over the cloth."""

    mean: float
    p95: float
    max: float


class Pressure(Spread):
    """Pressure where the cloth touches."""

    touching: float
    """Share of the cloth."""


class DrapeStrain(Entry):
    """Strain of the draped cloth, or its shear [degrees]."""

    p5: float
    p95: float
    min: float
    max: float


class Place(Entry):
    """A place where the cloth does not lie as designed."""

    kind: str
    line: str
    worst: float
    gap_m: float
    area_m2: float
    words: str
    fails: bool = False
    """Whether the garment does not fit because of it."""


class CorrectionRound(Entry):
    """The misfit after a round of the correction."""

    misfit_m: float
    misfit_p95_m: float
    beyond_limit: float
    share: float


class CorrectedEdge(Entry):
    """How far an edge of the outline moves outwards, and how much longer it becomes."""

    mean_m: float
    max_m: float
    longer_m: float


class Correction(Entry):
    """The corrected pattern."""

    reason: str
    fabric: str
    rounds: list[CorrectionRound]
    seam_difference_m: float
    edges: dict[str, CorrectedEdge]


class Drape(Entry):
    """The garment on its body."""

    converged: bool
    residual: float
    steps: int
    stalled: bool
    """Given up, as its forces did not become smaller."""
    seconds: float
    vertices: int
    friction: float
    bending_n_m: float
    compared_with: Literal["body", "designed surface"]
    """What the distances are from: the body for a pattern without a designed surface."""
    distance_m: Spread
    misfit_m: Spread
    bridged_m: Spread
    deepest_m: float
    gap_m: dict[str, float]
    strain_limit: float
    shear_limit: float | None
    """[degrees]; none of an isotropic sheet."""
    outside: float
    """Share of the cloth beyond its limits."""
    strain_warp: DrapeStrain
    strain_weft: DrapeStrain
    shear: DrapeStrain
    pressure_pa: Pressure
    places: list[Place]
    correction: Correction | None = None


class PanelDistances(Entry):
    """How far what flattening gives lies from a pattern that was taken as it is, laid on it, turned and moved."""

    mean_mm: float
    p95_mm: float


class CutPattern(PanelDistances):
    """A pattern that is a worn mesh's texture, and was taken as it is."""

    unit: str
    """Of the texture."""
    area_ratio: float
    """Its area over that of the worn cloth."""
    pieces: dict[str, PanelDistances]


class FoundSeam(Entry):
    """A seam of a whole garment, and its price."""

    name: str
    length_m: float
    released_j: float | None
    """Strain energy that it releases, by trial; none where nothing was tried."""
    needed: str
    """Why the cloth cannot lie flat without it; empty where it can."""


class FoundGarment(Entry):
    """What a garment is whose seams were found."""

    what: str
    outside: float
    """Share of the cloth beyond its limits."""
    found_seams: list[FoundSeam]
    notes: list[str]
    no_pattern: str | None = None
    """Why this is no pattern yet."""


class Finding(Entry):
    """One thing that the verdict rests on."""

    kind: Literal["held", "pressing", "too large", "misfit", "not at rest", "folds", "ease", "opening"]
    fails: bool
    """Whether the garment does not fit because of it; otherwise it is told."""
    words: str
    remedy: str


class Verdict(Entry):
    """Whether the garment fits, said once: console, review page, print and batch read it here."""

    fits: bool
    by: Literal["strain", "drape"]
    words: str
    findings: list[Finding]
    """Those that fail first."""


class Metrics(Entry):
    """The whole file."""

    schema_: Literal[1] = Field(alias="schema")
    warpflat: str
    warp: str
    device: str
    pieces: dict[str, Piece]
    wear: GarmentWear | None = None
    mannequin: Body | None = None
    garment: FoundGarment | None = None
    seams: list[Seam] | None = None
    pairs: list[list[str]] | None = None
    pattern_of_file: CutPattern | None = None
    girths: dict[str, Girth] | None = None
    rings: list[Ring] | None = None
    constraints: list[Constraint] | None = None
    sewing: Sewing | None = None
    sizes: dict[str, dict[str, Any]] | None = None
    """Summaries of graded sizes."""
    pattern: Drawing | None = None
    curves: Curves | None = None
    corners: list[Corner] | None = None
    walked: list[WalkedSeam] | None = None
    cloths: list[ClothCut] | None = None
    marker: Marker | None = None
    drape: Drape | None = None
    verdict: Verdict | None = None
    notes: list[str] | None = None
    """Steps that were left out, and why."""
    left_out: list[str] | None = None
    """Those of them without which the pattern is not complete: the run ends with exit code 1."""
    files: dict[str, dict[str, str]] | None = None
    """SHA-256 of every file, by run and name."""
    sha256: str | None = None
    """Seal: the digest of the content, by which the file is known to be as it was written."""
