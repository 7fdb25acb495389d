// How the page is built: files that any browser of the last years reads, with nothing inline, so that the content security
// policy of the service can forbid whatever is.
import { readdir, readFile, writeFile } from 'node:fs/promises';
import path from 'node:path';
import { promisify } from 'node:util';
import { constants, gzip } from 'node:zlib';
import { defineConfig, type Plugin } from 'vite';

// Shorter files are sent as they are: the saving would be less than a packet.
const WORTH_COMPRESSING = 1400;

// Puts NAME.gz beside each file that gzip makes shorter; the service hands those out.
function compress(): Plugin {
  let folder = '';
  return {
    name: 'compress',
    apply: 'build',
    configResolved: ({ root, build }) => void (folder = path.resolve(root, build.outDir)),
    closeBundle: async () => {
      for (const entry of await readdir(folder, { recursive: true, withFileTypes: true })) {
        const file = path.join(entry.parentPath, entry.name);
        if (!entry.isFile() || !/\.(js|css|html|svg|txt)$/.test(file)) continue;
        const bytes = await readFile(file);
        if (bytes.length < WORTH_COMPRESSING) continue;
        await writeFile(`${file}.gz`, await promisify(gzip)(bytes, { level: constants.Z_BEST_COMPRESSION }));
      }
    },
  };
}

// For `npm run dev`: where everything comes from that is not the page's.
const service = process.env['HALFLIGHT_SERVICE'] ?? 'http://127.0.0.1:7000';

export default defineConfig({
  base: './',
  build: {
    target: 'es2022',
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    // three.js is one file of this length, and is fetched only when a scene is looked at.
    chunkSizeWarningLimit: 1000,
    license: { fileName: 'licences.txt' },
  },
  plugins: [compress()],
  // The service takes no calls from pages of other origins than its own.
  server: {
    proxy: {
      '/radiosity.v1.Radiosity': { target: service, changeOrigin: true, headers: { origin: service } },
      '/options.json': { target: service, changeOrigin: true },
    },
  },
});
