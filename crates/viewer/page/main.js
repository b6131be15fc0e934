/** @file The page begins: its parts, its line to the server, its address. */
import { store } from './store.js';
import { begin } from './address.js';
import './theme.js';
import './keys.js';
import './toolbar.js';
import './stage.js';
import './dock.js';
import './timeline.js';
import './messages.js';
import './save.js';
import './help.js';

addEventListener('error', (event) => store.notice(`A mistake in this page: ${event.message}`, 'error'));
addEventListener('unhandledrejection', (event) => store.notice(`A mistake in this page: ${event.reason?.message ?? event.reason}`, 'error'));

begin();
