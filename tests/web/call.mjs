// Functions of the page's modules, in Node.   node call.mjs SOURCES REQUEST ANSWER
//   request: [{module, name, arguments}]; an argument {head, arrays} is a model
import { readFileSync, writeFileSync } from 'node:fs';
import { pathToFileURL } from 'node:url';

const [sources, from, to] = process.argv.slice(2);
const load = name => import(pathToFileURL(`${sources}/${name}`));
const { Model } = await load('model.js');
const numbers = values => Float64Array.from(values, x => x ?? NaN); // JSON has no NaN

function revived(argument) {
  if (!argument?.arrays) return argument;
  const arrays = Object.entries(argument.arrays).map(([name, values]) => [name, numbers(values)]);
  return new Model(argument.head, Object.fromEntries(arrays));
}

const answers = [];
for (const { module, name, arguments: given } of JSON.parse(readFileSync(from, 'utf8'))) {
  const values = given.map(revived);
  const owner = values[0] instanceof Model && name in values[0] ? values.shift() : await load(module);
  answers.push(owner[name](...values) ?? null);
}
writeFileSync(to, JSON.stringify(answers));
