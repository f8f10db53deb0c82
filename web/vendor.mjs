// Makes the vendored files anew: three.js bundled for the page, axe-core for its tests, each with
// its licence, and a list of versions and hashes that a test holds the files to.
import { createHash } from "node:crypto";
import { copyFileSync, mkdirSync, readFileSync, writeFileSync } from "node:fs";
import { dirname, join } from "node:path";
import { fileURLToPath } from "node:url";
import { buildSync } from "esbuild";

const here = dirname(fileURLToPath(import.meta.url));
const own = (name) => join(here, "node_modules", name);
const read = (path) => JSON.parse(readFileSync(path, "utf8"));
const locked = read(join(here, "package-lock.json")).packages;

function vendor(folder, name, files) {
  const { version, license } = read(join(own(name), "package.json"));
  const { integrity } = locked[`node_modules/${name}`];
  const sha256 = (file) =>
    createHash("sha256").update(readFileSync(join(folder, file))).digest("hex");
  const hashes = Object.fromEntries(files.map((file) => [file, sha256(file)]));
  const told = { made_by: "make web", name, version, license, npm_integrity: integrity, sha256: hashes };
  writeFileSync(join(folder, "VENDORED.json"), JSON.stringify(told, null, 2) + "\n");
}

const page = join(here, "../src/legato/web/static/vendor");
mkdirSync(page, { recursive: true });
buildSync({
  entryPoints: [join(here, "three.js")],
  outfile: join(page, "three.js"),
  bundle: true,
  format: "esm",
  minify: true,
  legalComments: "eof",
  logLevel: "warning",
});
copyFileSync(join(own("three"), "LICENSE"), join(page, "three.LICENSE"));
vendor(page, "three", ["three.js", "three.LICENSE"]);

const axe = join(here, "../tests/vendor/axe-core");
mkdirSync(axe, { recursive: true });
copyFileSync(join(own("axe-core"), "axe.min.js"), join(axe, "axe.min.js"));
copyFileSync(join(own("axe-core"), "LICENSE"), join(axe, "LICENSE"));
copyFileSync(join(own("axe-core"), "LICENSE-3RD-PARTY.txt"), join(axe, "LICENSE-3RD-PARTY.txt"));
vendor(axe, "axe-core", ["axe.min.js", "LICENSE", "LICENSE-3RD-PARTY.txt"]);
