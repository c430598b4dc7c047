// Builds the page's parts into dist/: one classic script, one style sheet, the template, the worker, the licences.
//   node build.mjs [--force]      nothing is done where dist/ was made from these very sources
import { createHash } from 'node:crypto';
import { existsSync, mkdirSync, readFileSync, readdirSync, writeFileSync } from 'node:fs';
import { dirname, join } from 'node:path';
import { fileURLToPath } from 'node:url';

const HERE = dirname(fileURLToPath(import.meta.url));
const SOURCES = join(HERE, 'src');
const OUT = join(HERE, 'dist');
const PACKAGES = join(HERE, 'node_modules');
const BROWSERS = ['chrome111', 'firefox113', 'safari16.4'];
const OUTPUTS = ['page.js', 'page.css', 'page.html', 'licences.txt', 'worker.js'];

const text = path => readFileSync(path, 'utf8');
const json = path => JSON.parse(text(path));

// SHA-256 of all that decides about the result, names included
function fingerprint() {
  const hash = createHash('sha256');
  const files = [
    'package.json',
    'package-lock.json',
    'build.mjs',
    ...readdirSync(SOURCES)
      .sort()
      .map(f => `src/${f}`),
  ];
  for (const file of files) {
    const content = readFileSync(join(HERE, file));
    hash.update(`${file}\0${content.length}\0`).update(content);
  }
  return hash.digest('hex');
}

function isUpToDate(sources) {
  const record = join(OUT, 'build.json');
  if (!existsSync(record) || json(record).sources !== sources) return false;
  return json(record).files.every(file => existsSync(join(OUT, file)));
}

// Bundle one entry as a classic script; returns the packages that went into it.
async function bundle(build, entry, out) {
  const result = await build({
    entryPoints: [join(SOURCES, entry)],
    outfile: join(OUT, out),
    bundle: true,
    minify: true,
    format: 'iife',
    target: BROWSERS,
    charset: 'utf8',
    legalComments: 'none',
    metafile: true,
    logLevel: 'warning',
    absWorkingDir: HERE,
  });
  const inputs = Object.keys(result.metafile.inputs);
  return inputs.map(path => /^node_modules\/((?:@[^/]+\/)?[^/]+)/.exec(path)?.[1]).filter(Boolean);
}

async function style(build) {
  const contents = '@import "uplot/dist/uPlot.min.css";\n' + text(join(SOURCES, 'style.css'));
  const stdin = { contents, loader: 'css', resolveDir: HERE };
  await build({
    stdin,
    outfile: join(OUT, 'page.css'),
    bundle: true,
    minify: true,
    target: BROWSERS,
    logLevel: 'warning',
  });
}

function licence(name) {
  const folder = join(PACKAGES, name);
  const file = readdirSync(folder).find(f => /^licen[cs]e(\.|$)/i.test(f));
  if (!file) throw new Error(`${folder}: no licence file; what is bundled must carry its licence`);
  const { version, license } = json(join(folder, 'package.json'));
  return `${name} ${version} (${license})\n\n${text(join(folder, file)).trim()}\n`;
}

async function main() {
  const sources = fingerprint();
  if (!process.argv.includes('--force') && isUpToDate(sources)) return console.log('page: dist/ is up to date');
  const { build } = await import('esbuild');
  mkdirSync(OUT, { recursive: true });
  const bundled = new Set(['uplot', ...(await bundle(build, 'main.js', 'page.js'))]);
  const worker = existsSync(join(SOURCES, 'worker.js'));
  if (worker) for (const name of await bundle(build, 'worker.js', 'worker.js')) bundled.add(name);
  await style(build);
  writeFileSync(join(OUT, 'page.html'), text(join(SOURCES, 'page.html')));
  const names = [...bundled].sort();
  writeFileSync(join(OUT, 'licences.txt'), names.map(licence).join(`\n${'-'.repeat(72)}\n\n`));
  const versions = Object.fromEntries(names.map(name => [name, json(join(PACKAGES, name, 'package.json')).version]));
  const esbuild = json(join(PACKAGES, 'esbuild', 'package.json')).version;
  const record = {
    format: 1,
    sources,
    esbuild,
    bundled: versions,
    files: OUTPUTS.filter(f => worker || f !== 'worker.js'),
  };
  writeFileSync(join(OUT, 'build.json'), JSON.stringify(record, null, 2) + '\n');
  console.log(`page: ${record.files.map(f => `${f} ${Math.ceil(text(join(OUT, f)).length / 1024)} kB`).join(', ')}`);
}

await main();
