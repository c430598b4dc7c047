// The judge of the page, in Node: holds tables against limits.   node judge.mjs SOURCES REQUEST ANSWER
//   request: [{table: {name: values}, start: {limits, pitch}, mass, tension}]
import { readFileSync, writeFileSync } from 'node:fs';
import { pathToFileURL } from 'node:url';

const [sources, from, to] = process.argv.slice(2), module = name => import(pathToFileURL(`${sources}/${name}`));
const { judge, limitsFor, TENSION_ALONG } = await module('judge.js'), { Model } = await module('model.js');
const numbers = values => Float64Array.from(values, x => (x === null ? NaN : x));   // JSON has no NaN
const answers = JSON.parse(readFileSync(from, 'utf8')).map(({ table, start, mass, tension }) => {
  const arrays = Object.fromEntries(Object.entries(table).map(([name, values]) => [name, numbers(values)]));
  if (tension) arrays[TENSION_ALONG] = numbers(tension);
  return judge(limitsFor(start, mass), new Model({}, arrays));
});
writeFileSync(to, JSON.stringify(answers));
