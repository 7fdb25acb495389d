// The bearer token, where the service wants one. It is kept for this tab alone, and goes when the tab does.

const KEY = 'halflight-token';

/** The token, or nothing. */
export function token(): string | null {
  return sessionStorage.getItem(KEY);
}

/** Keeps a token for this tab; an empty one forgets it. */
export function setToken(value: string): void {
  if (value === '') sessionStorage.removeItem(KEY);
  else sessionStorage.setItem(KEY, value);
}
