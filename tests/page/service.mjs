// The real service, for as long as a test takes.
import { spawn } from 'node:child_process';
import { mkdtemp, rm } from 'node:fs/promises';
import { tmpdir } from 'node:os';
import path from 'node:path';
import { createInterface } from 'node:readline';

const TOP = path.join(import.meta.dirname, '..', '..');

/** COORDINATOR names the program. */
const PROGRAM = path.resolve(process.env.COORDINATOR ?? path.join(TOP, 'target', 'release', 'coordinator'));

/** A scene of tests/scenes. */
export const scene = (name) => path.join(TOP, 'tests', 'scenes', `${name}.glb`);

/** Starts a service on a free port, with these options besides; `end` stops it and removes what it kept. */
export async function startService(...options) {
  const data = await mkdtemp(path.join(tmpdir(), 'halflight-page-'));
  const service = spawn(PROGRAM, ['serve', '--listen', '127.0.0.1:0', '--data', data, ...options], {
    stdio: ['ignore', 'pipe', 'inherit'],
  });
  const ended = new Promise((resolve) => service.once('close', resolve));
  const end = async () => {
    service.kill('SIGTERM');
    await ended;
    await rm(data, { recursive: true, force: true });
  };
  for await (const line of createInterface({ input: service.stdout })) {
    const address = / on ([\d.]+:\d+)/.exec(line)?.[1];
    if (address) return { origin: `http://${address}`, end };
  }
  await end();
  throw new Error('the service does not start');
}
