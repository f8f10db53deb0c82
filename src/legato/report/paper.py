"""What the paper printed, to set beside what was measured. Source: paper table 5.3, section 5."""

from collections.abc import Mapping

# Columns of table 5.3 by gene: poses a to d. s_x of pose a is misprinted as 173.9.77.
POSES = ("a", "b", "c", "d")
TABLE_5_3: Mapping[str, tuple[float | None, float, float, float]] = {
    "f": (5.61, 6.04, 5.23, 3.9),
    "s_x": (None, 116.0, 181.79, 157.3),
    "s_y": (179.6, 171.0, 161.25, 148.7),
    "u0": (326.9, 347.3, 324.5, 333.4),
    "v0": (308.4, 273.2, 288.29, 256.2),
    "t_x": (-25.08, -66.9, -24.8, -22.6),
    "t_y": (-14.54, 11.93, -13.75, -3.14),
    "t_z": (163.8, 109.1, 149.33, 74.7),
    "omega": (1.662, 1.37, 1.66, 1.71),
    "phi": (0.054, -0.102, 0.397, 0.086),
    "kappa": (0.64, 0.6005, 1.04, 0.705),
}

# Distance between the paper's published pose and its stated placement of the leg.
PLACEMENT_ERROR_MM = 13.35
