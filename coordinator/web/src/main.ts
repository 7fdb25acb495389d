import { App } from './page/app';

new App(document.querySelector('#page')!);
