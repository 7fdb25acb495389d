// The Khronos glTF validator on files: node validate.mjs FILE...
// Prints errors and warnings; exits with 1 when there is one, 2 when nothing was asked.
import { readFile } from 'node:fs/promises';
import path from 'node:path';
import validator from 'gltf-validator';

const SEVERITIES = ['error', 'warning'];

const files = process.argv.slice(2);
if (files.length === 0) {
  console.error('usage: node validate.mjs FILE...');
  process.exit(2);
}

let failed = false;
for (const file of files) {
  try {
    const report = await validator.validateBytes(new Uint8Array(await readFile(file)), {
      uri: path.basename(file),
      maxIssues: 0,
      externalResourceFunction: async (uri) =>
        new Uint8Array(await readFile(path.join(path.dirname(file), decodeURIComponent(uri)))),
    });
    const { numErrors, numWarnings, messages } = report.issues;
    for (const { severity, code, message, pointer } of messages) {
      if (severity < SEVERITIES.length) {
        console.log(`${file}: ${SEVERITIES[severity]} ${code} at ${pointer ?? 'the file'}: ${message}`);
      }
    }
    console.log(`${file}: ${numErrors} errors, ${numWarnings} warnings`);
    failed ||= numErrors + numWarnings > 0;
  } catch (error) {
    console.log(`${file}: ${error.message ?? error}`);
    failed = true;
  }
}
process.exit(failed ? 1 : 0);
