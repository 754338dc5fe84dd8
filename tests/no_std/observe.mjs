// Runs the observers as WebAssembly: they take a sample, and refuse a sample time that is not positive.
import assert from 'node:assert/strict';
import { readFile } from 'node:fs/promises';

const { instance } = await WebAssembly.instantiate(await readFile(process.argv[2]));
assert.equal(instance.exports.observe(1e-3, 0.1, 0.2), 1);
assert.equal(instance.exports.observe(-1e-3, 0.1, 0.2), 0);
