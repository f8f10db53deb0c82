// Figures in words: where the arm is, how old the picture is, what the calibration is worth.

import { $, ago, clock, fill, fixed, h, say } from "./dom.js";
import { repetitions, simulatedDevices } from "./head.js";
import { on } from "./live.js";

const cells = {};

function rows(list, names) {
  fill($(list), names.map(([key, text]) => h("div", {}, h("dt", {}, text), (cells[key] = h("dd", {}, "\u2013")))));
}
rows("readings", [["place", "Fingertip x, y, z"], ["turn", "Pitch, roll"], ["joints", "Base, shoulder, elbow"], ["touch", "Switch"]]);
rows("known", [["arm", "Arm"], ["camera", "Camera"], ["calibration", "Calibration"], ["sigma", "Worst station known to"], ["rms", "Residuals"], ["lease", "Lease"], ["campaign", "Campaign"], ["version", "Daemon"], ["pace", "Simulated time"]]);
cells.pace.parentElement.hidden = true;

function put(key, text, tone = "") {
  say(cells[key], text);
  cells[key].className = tone;
}

on("arm status", ({ arm, status }) => {
  if (!arm) return;
  const placed = arm.xyz_mm !== null;
  put("place", placed ? `${arm.xyz_mm.map((v) => fixed(v, 1)).join(", ")} mm` : "not known: reference the arm", placed ? "" : "warn");
  put("turn", placed ? `${fixed(arm.pitch_deg, 1)}\u00b0, ${fixed(arm.roll_deg, 1)}\u00b0` : "\u2013");
  put("joints", arm.joints_deg ? `${arm.joints_deg.slice(0, 3).map((v) => fixed(v, 1)).join("\u00b0, ")}\u00b0` : "\u2013");
  const where = arm.station_mm !== null && arm.station_mm !== undefined && arm.why && arm.why !== "transit" ? `, ${arm.why} at ${arm.station_mm} mm` : arm.why ? `, ${arm.why}` : "";
  put("touch", arm.contact === null ? "\u2013" : `${arm.contact ? "closed: touching" : "open"}${where}`, arm.contact ? "busy" : "");
  // The simulated world puts its arm in place by itself: nobody has vouched for that.
  const simulated = simulatedDevices(status).includes("arm");
  const standing = !arm.connected ? "not connected" : !arm.referenced ? "connected, not referenced"
    : simulated ? "connected, in place by simulation" : "connected, referenced";
  put("arm", standing, !arm.connected || !arm.referenced ? "warn" : simulated ? "" : "good");
});

// Times of day are the wall's; only here is said that the cell's seconds are others.
on("cell", ({ cell }) => {
  cells.pace.parentElement.hidden = cell.time_scale === 1;
  put("pace", `${cell.time_scale} s of the cell in 1 s of the wall. Times of day are the wall\u2019s, seconds in messages the cell\u2019s.`);
});

on("status", ({ status }) => {
  const { camera, calibration, lease, when } = status;
  const age = when.picture ? `last picture at ${clock(when.picture)}` : "no picture yet";
  put("camera", camera.connected ? `connected, ${age}` : "not connected", camera.connected ? "good" : "warn");
  put("calibration", calibration ? `${calibration.valid ? "verified" : "not verified"}, ${clock(when.calibration)}` : "none", calibration?.valid ? "good" : "warn");
  put("sigma", calibration ? `${fixed(calibration.sigma_mm, 3)} mm` : "\u2013");
  put("rms", calibration ? `${fixed(calibration.rms_px, 3)} px rms` : "\u2013");
  put("lease", lease ? `held by ${lease.holder ?? lease.by ?? "another client"}` : "free");
  const campaign = status.campaign;
  put("campaign", campaign ? `${repetitions(campaign)}${campaign.underway ? "" : `: ${campaign.outcome}`}` : "none", campaign?.underway ? "busy" : "");
  put("version", `legato ${status.version}, up ${ago(status.uptime_s)}`);
});
