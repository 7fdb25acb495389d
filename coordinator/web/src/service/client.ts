// The service, as gRPC-web reaches it from the page's own origin.

import { Code, ConnectError, createClient, type Interceptor } from '@connectrpc/connect';
import { createGrpcWebTransport } from '@connectrpc/connect-web';
import { Radiosity } from '../messages/radiosity/v1/radiosity_pb';
import { token } from './token';

/** Adds the token to every call. */
export const authorise: Interceptor = (next) => (request) => {
  const secret = token();
  if (secret !== null) request.header.set('authorization', `Bearer ${secret}`);
  return next(request);
};

/** Where the service is: where the page came from. */
export const BASE_URL = new URL('.', document.baseURI).href.replace(/\/$/, '');

/** Every call but the submission, which sends more than one message. */
export const client = createClient(
  Radiosity,
  createGrpcWebTransport({ baseUrl: BASE_URL, interceptors: [authorise] }),
);

/** Whether a call failed for want of a token that the service knows. */
export function wantsToken(error: unknown): boolean {
  return ConnectError.from(error).code === Code.Unauthenticated;
}

/** What went wrong, in a sentence. */
export function explain(error: unknown): string {
  const { code, rawMessage } = ConnectError.from(error);
  if (code === Code.Canceled) return 'cancelled';
  // A browser says no more of a connection than that it failed.
  if (/failed to fetch|networkerror|load failed/i.test(rawMessage)) return 'the service does not answer';
  return rawMessage || Code[code];
}
