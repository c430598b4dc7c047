// The worker of the page, in Node: solves the wishes of a request, and writes its answers.
//   node worker.mjs SOURCES REQUEST ANSWER     request: {wasm, about, blocks, wishes: [{start, wishes, step, end}], together}
import { readFileSync, writeFileSync } from 'node:fs';
import { pathToFileURL } from 'node:url';

const [sources, from, to] = process.argv.slice(2), request = JSON.parse(readFileSync(from, 'utf8'));
const about = JSON.parse(readFileSync(request.about, 'utf8')), raw = readFileSync(request.blocks);
const blocks = new Float64Array(raw.buffer.slice(raw.byteOffset, raw.byteOffset + raw.length));
const answers = [], waiting = new Map();
globalThis.onmessage = null;
globalThis.postMessage = answer => { answers.push(answer); waiting.get(answer.id)?.(answer); };
await import(pathToFileURL(`${sources}/worker.js`));

const send = data => globalThis.onmessage({ data });
const wasm = readFileSync(request.wasm);
send({ wasm: wasm.buffer.slice(wasm.byteOffset, wasm.byteOffset + wasm.length) });
const ask = ({ start: number, wishes, step, end }, id) => new Promise(done => {
  const start = about.starts[number ?? 0], block = blocks.slice(start.first, start.first + start.given);
  const own = Object.fromEntries(start.sliders.map(slider => [slider.name, slider.value]));
  waiting.set(id, done);
  send({ id, start, block, wishes: { ...own, ...wishes }, step: step ?? about.step, end: end ?? about.end, frame: 0.02 });
});
if (request.together) await Promise.all(request.wishes.map(ask));
else for (const [i, wish] of request.wishes.entries()) await ask(wish, i);

// Arrays as lists of numbers, in the order in which the answers came.
const plain = value => (ArrayBuffer.isView(value) ? Array.from(value) : value && typeof value === 'object' ? Object.fromEntries(Object.entries(value).map(([k, v]) => [k, plain(v)])) : value);
writeFileSync(to, JSON.stringify(answers.map(plain)));
