// The dialog for the token of a service that requires one.

import { html, nothing, type TemplateResult } from 'lit-html';
import { ref } from 'lit-html/directives/ref.js';
import { setToken, token } from '../service/token';

/** The dialog, open while the service knows no token of the client; `changed` is called when there is another. */
export function tokenDialog(isOpen: boolean, changed: () => void): TemplateResult {
  const known = token();
  return html`
    ${known !== null && !isOpen
      ? html`<button type="button" @click=${() => take('', changed)}>Forget token</button>`
      : nothing}
    ${isOpen
      ? html`<dialog aria-labelledby="token-title" @cancel=${(event: Event) => event.preventDefault()}
          ${ref((dialog) => showModal(dialog as HTMLDialogElement | undefined))}>
          <form @submit=${(event: Event) => {
            event.preventDefault();
            take(String(new FormData(event.target as HTMLFormElement).get('token')).trim(), changed);
          }}>
            <h2 id="token-title">Token</h2>
            <p>${known === null ? 'This service requires a token.' : 'The service does not know this token.'} The token is kept until this tab is closed.</p>
            <label for="token">Bearer token</label>
            <input id="token" name="token" type="password" autocomplete="off" required autofocus />
            <button class="main">Continue</button>
          </form>
        </dialog>`
      : nothing}
  `;
}

function take(value: string, changed: () => void): void {
  setToken(value);
  changed();
}

function showModal(dialog: HTMLDialogElement | undefined): void {
  // The element is put into the page after this call.
  queueMicrotask(() => dialog?.isConnected && !dialog.open && dialog.showModal());
}
