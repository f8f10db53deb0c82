// Figures in words: where the arm is, how old the picture is, what the calibration is worth.

import { $, ago, fill, fixed, h, say } from "./dom.js";
import { repetitions } from "./head.js";
import { on } from "./live.js";

const cells = {};

function rows(list, names) {
  fill($(list), names.map(([key, text]) => h("div", {}, h("dt", {}, text), (cells[key] = h("dd", {}, "\u2013")))));
}
rows("readings", [["place", "Fingertip x, y, z"], ["turn", "Pitch, roll"], ["joints", "Base, shoulder, elbow"], ["touch", "Switch"]]);
rows("known", [["arm", "Arm"], ["camera", "Camera"], ["calibration", "Calibration"], ["sigma", "Worst station known to"], ["rms", "Residuals"], ["lease", "Lease"], ["campaign", "Campaign"], ["version", "Daemon"]]);

function put(key, text, tone = "") {
  say(cells[key], text);
  cells[key].className = tone;
}

on("arm", ({ arm }) => {
  const known = arm.xyz_mm !== null;
  put("place", known ? `${arm.xyz_mm.map((v) => fixed(v, 1)).join(", ")} mm` : "not known: reference the arm", known ? "" : "warn");
  put("turn", known ? `${fixed(arm.pitch_deg, 1)}\u00b0, ${fixed(arm.roll_deg, 1)}\u00b0` : "\u2013");
  put("joints", arm.joints_deg ? `${arm.joints_deg.slice(0, 3).map((v) => fixed(v, 1)).join("\u00b0, ")}\u00b0` : "\u2013");
  const where = arm.station_mm !== null && arm.station_mm !== undefined && arm.why && arm.why !== "transit" ? `, ${arm.why} at ${arm.station_mm} mm` : arm.why ? `, ${arm.why}` : "";
  put("touch", arm.contact === null ? "\u2013" : `${arm.contact ? "closed: touching" : "open"}${where}`, arm.contact ? "busy" : "");
  const standing = !arm.connected ? "not connected" : arm.referenced ? "connected, referenced" : "connected, not referenced";
  put("arm", standing, arm.connected && arm.referenced ? "good" : "warn");
});

on("status", ({ status }) => {
  const { camera, calibration, lease } = status;
  const age = camera.age_s === null ? "no picture yet" : `last picture ${ago(camera.age_s)} old`;
  put("camera", camera.connected ? `connected, ${age}` : "not connected", camera.connected ? "good" : "warn");
  put("calibration", calibration ? `${calibration.valid ? "verified" : "not verified"}, ${ago(calibration.age_s)} old` : "none", calibration?.valid ? "good" : "warn");
  put("sigma", calibration ? `${fixed(calibration.sigma_mm, 3)} mm` : "\u2013");
  put("rms", calibration ? `${fixed(calibration.rms_px, 3)} px rms` : "\u2013");
  put("lease", lease ? `held by ${lease.holder ?? lease.by ?? "another client"}` : "free");
  const campaign = status.campaign;
  put("campaign", campaign ? `${repetitions(campaign)}${campaign.underway ? "" : `: ${campaign.outcome}`}` : "none", campaign?.underway ? "busy" : "");
  put("version", `legato ${status.version}, up ${ago(status.uptime_s)}`);
});
