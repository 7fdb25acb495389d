// Submits scenes.
//
// A browser cannot hold a stream of messages open towards a server, but nothing of a submission depends on an answer: header
// and chunks are known beforehand, so they are the body of one request, put together of pieces of the file without reading it.

import { create, type MessageInitShape } from '@bufbuild/protobuf';
import { BinaryWriter, WireType } from '@bufbuild/protobuf/wire';
import { Code, ConnectError } from '@connectrpc/connect';
import { createGrpcWebTransport } from '@connectrpc/connect-web';
import { sha256 } from '@noble/hashes/sha2.js';
import {
  Radiosity,
  SceneFileSchema,
  SubmitSceneHeaderSchema,
  SubmitSceneRequestSchema,
  type Job,
  type SubmitSceneRequest,
} from '../messages/radiosity/v1/radiosity_pb';
import { authorise, BASE_URL } from './client';

// Bytes of a file in one message: what the service takes at most.
const CHUNK = 1 << 20;

/** How far a submission is: what it is doing, and the part of it that is done. */
export type SubmissionProgress = (step: 'reading' | 'sending', part: number) => void;

/** Submits a file; its bytes are sent only if the service does not have them. */
export async function submit(
  file: File,
  header: MessageInitShape<typeof SubmitSceneHeaderSchema>,
  progress: SubmissionProgress,
  signal: AbortSignal,
): Promise<Job> {
  const digest = await digestOf(file, (part) => progress('reading', part), signal);
  const value = create(SubmitSceneHeaderSchema, header);
  value.source = { case: 'file', value: create(SceneFileSchema, { sha256: digest, size: BigInt(file.size) }) };
  const request = create(SubmitSceneRequestSchema, { body: { case: 'header', value } });
  try {
    return await send(request, [], () => {}, signal);
  } catch (error) {
    if (ConnectError.from(error).code !== Code.FailedPrecondition) throw error;
  }
  return send(request, chunksOf(file), (part) => progress('sending', part), signal);
}

/** SHA-256, piece by piece: a file may be longer than the memory of a phone. */
async function digestOf(file: File, progress: (part: number) => void, signal: AbortSignal): Promise<Uint8Array<ArrayBuffer>> {
  const hash = sha256.create();
  let done = 0;
  const reader = file.stream().getReader();
  for (let read = await reader.read(); !read.done; read = await reader.read()) {
    signal.throwIfAborted();
    hash.update(read.value);
    done += read.value.length;
    progress(done / file.size);
  }
  return new Uint8Array(hash.digest());
}

/** The messages of the file's bytes, each with what gRPC puts before it: a flag, and its length in four bytes. */
function chunksOf(file: File): BlobPart[] {
  const parts: BlobPart[] = [];
  for (let start = 0; start < file.size; start += CHUNK) {
    const piece = file.slice(start, start + CHUNK);
    const field = new BinaryWriter()
      .tag(SubmitSceneRequestSchema.field['chunk']!.number, WireType.LengthDelimited)
      .uint32(piece.size)
      .finish();
    const before = new DataView(new ArrayBuffer(5));
    before.setUint32(1, field.length + piece.size);
    parts.push(before, new Uint8Array(field), piece);
  }
  return parts;
}

/** Sends the first message and what follows it, as one body. */
async function send(
  first: SubmitSceneRequest,
  rest: BlobPart[],
  progress: (part: number) => void,
  signal: AbortSignal,
): Promise<Job> {
  const transport = createGrpcWebTransport({
    baseUrl: BASE_URL,
    interceptors: [authorise],
    fetch: (url, init) => post(String(url), init ?? {}, rest, progress),
  });
  // The transport writes one message and reads one answer, as for a method without streams.
  const method = { ...Radiosity.method.submitScene, methodKind: 'unary' as const };
  const { message } = await transport.unary(method, signal, undefined, undefined, first);
  return message;
}

/** As `fetch`, with more after the body; unlike `fetch`, it says how much is sent. */
function post(url: string, init: RequestInit, rest: BlobPart[], progress: (part: number) => void): Promise<Response> {
  return new Promise((resolve, reject) => {
    const request = new XMLHttpRequest();
    request.open('POST', url);
    request.responseType = 'arraybuffer';
    new Headers(init.headers).forEach((value, name) => request.setRequestHeader(name, value));
    request.upload.onprogress = ({ loaded, total }) => progress(total > 0 ? loaded / total : 0);
    request.onload = () => resolve(new Response(request.response, { status: request.status, headers: headersOf(request) }));
    request.onerror = () => reject(new ConnectError('the service does not answer', Code.Unavailable));
    request.onabort = () => reject(new ConnectError('cancelled', Code.Canceled));
    init.signal?.addEventListener('abort', () => request.abort());
    request.send(new Blob([init.body as Uint8Array<ArrayBuffer>, ...rest]));
  });
}

function headersOf(request: XMLHttpRequest): Headers {
  const headers = new Headers();
  for (const line of request.getAllResponseHeaders().trim().split(/\r\n/)) {
    const [name, ...value] = line.split(': ');
    if (name) headers.append(name, value.join(': '));
  }
  return headers;
}
