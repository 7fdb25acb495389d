// Fetches lit files.

import { ConnectError, Code } from '@connectrpc/connect';
import { client } from './client';

/** A file of the service. */
export interface Fetched {
  bytes: Uint8Array<ArrayBuffer>;
  name: string;
  mediaType: string;
  /** Number of the preview; 0 for a result. */
  preview: bigint;
}

/** Fetches the lit file of a finished job, or a preview of a running one. */
export async function fetchResult(
  id: string,
  isPreview: boolean,
  progress: (part: number) => void,
  signal: AbortSignal,
): Promise<Fetched> {
  let found: Fetched | undefined;
  let length = 0;
  for await (const { body } of client.fetchResult({ id, present: isPreview }, { signal })) {
    if (body.case === 'header') {
      const { size, fileName: name, mediaType, present: preview } = body.value;
      found = { bytes: new Uint8Array(Number(size)), name, mediaType, preview };
    } else if (body.case === 'chunk' && found) {
      if (length + body.value.length > found.bytes.length) throw new ConnectError('the file is longer than announced', Code.DataLoss);
      found.bytes.set(body.value, length);
      length += body.value.length;
      progress(length / found.bytes.length);
    }
  }
  if (!found || length < found.bytes.length) throw new ConnectError('the file is shorter than announced', Code.DataLoss);
  return found;
}

/** Saves a file as a browser download. */
export function save({ bytes, name, mediaType }: Fetched): void {
  const url = URL.createObjectURL(new Blob([bytes], { type: mediaType }));
  const link = document.createElement('a');
  link.href = url;
  link.download = name;
  link.click();
  // The browser has begun to read by then.
  setTimeout(() => URL.revokeObjectURL(url), 60_000);
}
