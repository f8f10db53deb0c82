"""Wrong configurations: text, the key at fault, what stands there, what should."""

from tests.unit.config.samples import SIM

CAMERA = '[camera]\nintrinsics = "lens.toml"\n'
PLACE = "[cell]\ncamera_at_mm = [228.6, -101.6, 50.8]\ncamera_looks_at_mm = [126.0, -4.0, 36.0]\n"
SKEWED = """[cell]
world_from_camera = [
  [0.009501, -0.9951, 0.00456, 124.29], [0.99664, 0.00891, -0.1004, -64.03],
  [0.1004, 0.000001, 0.99664, 30.52], [0.0, 0.0, 0.0, 1.0]]
"""
MIRRORED = """[cell]
world_from_camera = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, -1, 0], [0, 0, 0, 1]]
"""
SHEARED_ROW = """[cell]
world_from_camera = [[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, 0], [0, 0, 0.5, 1]]
"""
# What is appended to or put in place of the good file; key, value and expectation in the error.
BAD: list[tuple[str, str, str, str]] = [
    # Unknown keys, with the nearest that there is.
    (SIM + "[robot]\nsped_scale = 0.5\n", "robot.sped_scale", "0.5", "speed_scale"),
    (SIM + "[robt]\nport = 1\n", "robt", "{'port': 1}", "robot"),
    (SIM + "[calibration.bounds]\ng = [1, 2]\n", "calibration.bounds.g", "[1, 2]", "s_x"),
    (SIM + "[robot.home]\nxyz_mm = [1, 2, 3]\nyaw_deg = 3\n", "robot.home.yaw_deg", "3", "pitch"),
    # Wrong types.
    (SIM + "[robot]\nport = 5\n", "robot.port", "5", "a text"),
    (SIM + "[robot]\nswitch_active_low = 1\n", "robot.switch_active_low", "1", "true or false"),
    (SIM + "[robot]\nspeed_scale = '0.5'\n", "robot.speed_scale", "'0.5'", "a number"),
    (SIM + "[leg]\nstations_mm = [7.0, 'x']\n", "leg.stations_mm[1]", "'x'", "a number"),
    (SIM + "[leg.marks]\nP1 = [1, 2]\n", "leg.marks.P1", "[1, 2]", "a list of 3"),
    (SIM + "[leg]\nmarks = 3\n", "leg.marks", "3", "a table"),
    (SIM + "[sim]\nseed = 1.5\n", "sim.seed", "1.5", "a whole number"),
    (SIM + "[records]\nstate_dir = 1979-05-27\n", "records.state_dir", "1979", "a text"),
    (
        PLACE + "[camera]\nsource = 1.5\n",
        "camera.source",
        "1.5",
        "text in quotes (not empty) or a whole",
    ),
    ("robot = 3\n" + SIM, "robot", "3", "a table"),
    # Faults: a kind that there is, one beginning, a call of the device.
    (SIM + "[[sim.faults]]\nkind = 'fire'\ncall = 1\n", "sim.faults[0].kind", "'fire'", "arm_lost"),
    (SIM + "[[sim.faults]]\nkind = 'blank'\n", "sim.faults[0]", "", "one of at_s, call and p"),
    (
        SIM + "[[sim.faults]]\nkind = 'blank'\ncall = 1\np = 0.5\n",
        "sim.faults[0].p",
        "0.5",
        "one of at_s, call and p",
    ),
    (
        SIM + "[[sim.faults]]\nkind = 'blank'\ncall = 1\non = 'step'\n",
        "sim.faults[0].on",
        "step",
        "grab",
    ),
    (SIM + "[[sim.faults]]\nkind = 'blank'\np = 1.5\n", "sim.faults[0].p", "1.5", "at most 1"),
    # Out of range.
    (SIM + "[robot]\nspeed_scale = 3.0\n", "robot.speed_scale", "3.0", "at most 1"),
    (SIM + "[robot]\nbaud = 9601\n", "robot.baud", "9601", "9600"),
    (SIM + "[robot]\ndriver = 'puma'\n", "robot.driver", "'puma'", "teachmover"),
    (SIM + "[sim]\ntime_scale = nan\n", "sim.time_scale", "nan", "finite"),
    (SIM + "[sim]\nu0 = inf\n", "sim.u0", "inf", "finite"),
    (SIM + "[leg]\nstations_mm = []\n", "leg.stations_mm", "[]", "at least 1"),
    (SIM + "[massage]\ndescent_mm = 0.6\n", "massage.descent_mm", "0.6", "at most 0.5"),
    # Numbers that no cell has, each at its table's end.
    (SIM + "[records]\nkeep_days = 36501\n", "records.keep_days", "36501", "at most 36500"),
    (SIM + "[records]\nmin_free_mb = 10000001\n", "records.min_free_mb", "1", "most 10000000"),
    (SIM + "[massage]\nstrokes = 101\n", "massage.strokes", "101", "at most 100"),
    (SIM + "[massage]\ndwell_s = 60.1\n", "massage.dwell_s", "60.1", "at most 60"),
    (SIM + "[massage.draw]\ndwell_s = 61\n", "massage.draw.dwell_s", "61", "at most 60"),
    (SIM + "[massage.draw]\ncount = 101\n", "massage.draw.count", "101", "at most 100"),
    (SIM + "[massage]\npress_steps = 11\n", "massage.press_steps", "11", "10 steps at most"),
    (SIM + "[calibration]\npopulation = 10001\n", "calibration.population", "1", "most 10000"),
    (SIM + "[calibration]\ngenerations = 100001\n", "calibration.generations", "1", "100000"),
    (SIM + "[calibration]\nfresh_s = 604801\n", "calibration.fresh_s", "604801", "at most 604800"),
    (
        SIM + "[calibration.bounds]\nf = [1, 1e9]\n",
        "calibration.bounds.f[1]",
        "1000000000",
        "most 1000000",
    ),
    (SIM + "[robot]\nreply_margin_s = 1e9\n", "robot.reply_margin_s", "1000000000", "at most 60"),
    (SIM + "[robot]\nhand_mm = 1e300\n", "robot.hand_mm", "1e+300", "at most 10000"),
    (PLACE + CAMERA + "timeout_s = 61\n", "camera.timeout_s", "61", "at most 60"),
    (PLACE + CAMERA + "max_age_s = 61\n", "camera.max_age_s", "61", "at most 60"),
    (SIM + "[sim]\npicture_s = 61\n", "sim.picture_s", "61", "at most 60"),
    (SIM + "[sim]\ntime_scale = 1e5\n", "sim.time_scale", "100000", "at most 10000"),
    (SIM + "[sim]\nleg_at_mm = [0, 1e300, 0]\n", "sim.leg_at_mm[1]", "1e+300", "at most 100000"),
    # What cannot end in time.
    (
        SIM + "[massage]\nstrokes = 25\ndwell_s = 6\n",
        "massage.strokes",
        "25",
        "massage.dwell_s = 6 under the 900 s that a station may take, not 900 s",
    ),
    (
        SIM + "[massage]\nstrokes = 20\n[massage.draw]\ncount = 20\n",
        "massage.draw.count",
        "20",
        "massage.draw.dwell_s = 0.5 and massage.strokes under the 900 s",
    ),
    # Where the records are.
    (
        SIM + "[records]\nstate_dir = ''\n",
        "records.state_dir",
        "''",
        "a text in quotes (not empty)",
    ),
    (
        SIM + "[records]\nstate_dir = ' '\n",
        "records.state_dir",
        "' '",
        "a text in quotes (not empty)",
    ),
    (SIM + "[robot]\nport = ''\n", "robot.port", "''", "a text in quotes (not empty)"),
    (SIM + "[records]\nstate_dir = 'cell.toml'\n", "records.state_dir", "cell.toml", "a folder"),
    # The camera's place.
    (CAMERA, "cell.camera_at_mm", "nothing", "world_from_camera"),
    (
        CAMERA + "[cell]\ncamera_at_mm = [1, 2, 3]\n",
        "cell.camera_looks_at_mm",
        "nothing",
        "camera_at_mm with camera_looks_at_mm",
    ),
    (CAMERA + SKEWED, "cell.world_from_camera", "0.009501", "determinant 0.9985"),
    (CAMERA + SKEWED, "cell.world_from_camera", "0.99664", "the nearest is [[0.0"),
    (CAMERA + MIRRORED, "cell.world_from_camera", "-1", "determinant -1.0000"),
    (CAMERA + SHEARED_ROW, "cell.world_from_camera", "0.5", "last row"),
    (
        CAMERA + PLACE.replace("[126.0, -4.0, 36.0]", "[228.6, -101.6, 0.0]"),
        "cell.camera_looks_at_mm",
        "[228.6, -101.6, 0.0]",
        "horizontal distance",
    ),
    (
        SIM + "world_from_camera = [[1,0,0,0],[0,1,0,0],[0,0,1,0],[0,0,0,1]]\n",
        "cell.camera_at_mm",
        "[228.6",
        "one of the two",
    ),
    # Leg and marks.
    (SIM + "[leg]\nstations_mm = [7, 200]\n", "leg.stations_mm[1]", "200", "0 to leg.length_mm"),
    (SIM + "[leg]\nstations_mm = [67, 7]\n", "leg.stations_mm", "[67.0, 7.0]", "rising"),
    (SIM + "[leg]\nstations_mm = [7, 7]\n", "leg.stations_mm", "[7.0, 7.0]", "distinct"),
    (
        SIM + "[leg]\nstations_mm = [7, 7.0000001]\n",
        "leg.stations_mm",
        "7.0000001",
        "not 2 massage_7",
    ),
    (
        SIM + "[leg]\nsmall_radius_mm = 31.0\n",
        "leg.small_radius_mm",
        "31.0",
        "less than leg.big_radius_mm",
    ),
    (SIM + "[leg]\nbig_radius_mm = 32.0\n", "leg.marks.P2", "[12.9262", "surface to 0.5 mm"),
    (SIM + "[leg.marks]\nP1 = [0.0, 0.0, 25.0]\n", "leg.marks", "1 marks", "at least 7"),
    (SIM + "[calibration]\nmarks = ['P1', 'P99']\n", "calibration.marks[1]", "'P99'", "P10"),
    (SIM + "[calibration]\nmarks = ['P1', 'P1']\n", "calibration.marks", "['P1'", "once"),
    (SIM + "[calibration]\nmarks = ['P1']\n", "calibration.marks", "['P1']", "at least 6"),
    # Ranges.
    (SIM + "[calibration.bounds]\nf = [5, 5]\n", "calibration.bounds.f", "[5.0, 5.0]", "higher"),
    (SIM + "[calibration.bounds]\ns_x = [-1, 5]\n", "calibration.bounds.s_x", "-1.0", "above 0"),
    (SIM + "[calibration.bounds]\nt_z = [-9, 5]\n", "calibration.bounds.t_z", "-9.0", "in front"),
    (SIM + "[robot]\nelbow_deg = [0, -149]\n", "robot.elbow_deg", "[0.0, -149.0]", "higher"),
    (
        SIM + "[cell.workspace]\nx_mm = [330, 40]\n",
        "cell.workspace.x_mm",
        "[330.0, 40.0]",
        "higher",
    ),
    (
        SIM + "[massage]\ncontact_window_mm = 7\n[leg]\napproach_mm = 6\n",
        "massage.contact_window_mm",
        "7.0",
        "less than leg.approach_mm",
    ),
    # The arm's poses.
    (SIM + "[robot.home]\npitch_deg = -90.0\n", "robot.home.xyz_mm", "nothing", "this key"),
    (
        SIM + "[robot.home]\nxyz_mm = [10, 0, 150]\n",
        "robot.home.xyz_mm",
        "[10.0",
        "x inside cell.workspace",
    ),
    (
        SIM + "[robot.home]\nxyz_mm = [329, 249, 299]\n",
        "robot.home",
        "[329.0",
        "within the arm's reach and limits",
    ),
    (SIM + "[robot.start]\nxyz_mm = [900, 0, 0]\n", "robot.start", "[900.0", "out of reach"),
    (SIM + "[sim]\narm_at_mm = [900, 0, 0]\n", "sim.arm_at_mm", "[900.0", "out of reach"),
    (SIM + "[robot]\nfinger_length_mm = 99\n", "robot.finger_length_mm", "99.0", "robot.hand_mm"),
    # Where the daemon listens.
    (SIM + "[server]\nevents = 'tcp://*:5761'\n", "server.events", "tcp://*:5761", "loopback"),
    (SIM + "[server]\nstop = 'tcp://10.0.0.1:5'\n", "server.stop", "10.0.0.1", "encryption"),
    (SIM + "[server]\nrequests = 'tcp://127.0.0.1'\n", "server.requests", "127.0.0.1", "PORT"),
    (SIM + "[server]\nrequests = 'inproc://x'\n", "server.requests", "inproc://x", "tcp://"),
    (SIM + "[server]\nrequests = 'tcp://127.0.0.1:0'\n", "server.requests", ":0", "1 to 65535"),
    (
        SIM + "[server]\nevents = 'tcp://127.0.0.1:5760'\n",
        "server.events",
        "5760",
        "another endpoint than server.requests",
    ),
    # Intrinsics.
    (PLACE, "camera.intrinsics", "nothing", 'calibration.intrinsics = "known"'),
    (
        PLACE + "[camera]\nintrinsics = 'none.toml'\n",
        "camera.intrinsics",
        "none.toml",
        "a file that exists",
    ),
    (
        PLACE + CAMERA + "width = 640\nheight = 480\n",
        "camera.intrinsics",
        "768x576",
        "640x480",
    ),
]
