// Light or dark: as the system wants it, until somebody chooses.
'use strict';

const THEMES = ['dark', 'light'];
const wanted = new URLSearchParams(location.search).get('theme');
const system = matchMedia('(prefers-color-scheme: light)');

function setTheme(theme) {
  document.documentElement.dataset.theme = theme;
  dispatchEvent(new Event('theme'));
}

function stored() {
  try { return localStorage.getItem('i2ris-theme'); } catch { return null; }
}

function toggleTheme() {
  const next = THEMES.find((theme) => theme !== document.documentElement.dataset.theme);
  try { localStorage.setItem('i2ris-theme', next); } catch { /* Kept for this page only. */ }
  setTheme(next);
}

const systemTheme = () => (system.matches ? 'light' : 'dark');
setTheme([wanted, stored()].find((theme) => THEMES.includes(theme)) || systemTheme());
system.addEventListener('change', () => { if (!stored() && !wanted) setTheme(systemTheme()); });

// t: theme; o: the other page. Not while a key of the browser is held.
addEventListener('keydown', (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey) return;
  if (event.key === 't') toggleTheme();
  if (event.key === 'o') document.getElementById('other').click();
});
addEventListener('DOMContentLoaded', () => document.getElementById('theme').addEventListener('click', toggleTheme));
