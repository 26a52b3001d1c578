// Elements and tables of the page. All texts become text nodes: nothing of a scene is read as HTML.
'use strict';

/** An element. Attributes that are functions are event listeners; children are elements or texts. */
function element(tag, attributes = {}, ...children) {
  const out = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (value === undefined || value === null || value === false) continue;
    if (typeof value === 'function') out.addEventListener(name, value);
    else out.setAttribute(name, value === true ? '' : value);
  }
  for (const child of children.flat()) if (child !== null && child !== undefined) out.append(child);
  return out;
}

const Table = (() => {
  /** A number with at most four digits that count. */
  function text(value) {
    if (value === null || value === undefined) return '–';
    if (typeof value === 'boolean') return value ? 'yes' : 'no';
    if (typeof value !== 'number') return String(value);
    if (!Number.isFinite(value)) return String(value);
    if (value !== 0 && (Math.abs(value) < 1e-3 || Math.abs(value) >= 1e6)) return value.toExponential(3).replace(/\.?0+e/, 'e');
    return String(+value.toPrecision(5));
  }

  /** `joint_gap_m` as `joint gap (m)`; units are the words after the last known one. */
  const units = /_(m_per_s|rad_per_s|N_m_per_rad|N_m_s_per_rad|N_m_per_rad_s|kg_m2|N_m|ns|s|m|N|rad|kg|J)$/;
  function label(key) {
    const found = units.exec(key);
    const unit = found && found[1].replace(/_per_/g, '/').replace(/_/g, ' ');
    return (found ? key.slice(0, found.index) : key).replace(/_/g, ' ') + (unit ? ` (${unit})` : '');
  }

  const plain = value => value === null || typeof value !== 'object';

  /** Flat fields of an object: {a: {b: 1}} as {'a, b': 1}. */
  function flat(object, prefix = '', out = {}) {
    for (const [key, value] of Object.entries(object)) {
      if (plain(value)) out[prefix + key] = value;
      else if (!Array.isArray(value)) flat(value, prefix + key + ', ', out);
    }
    return out;
  }

  function cell(value, tag = 'td') {
    return element(tag, {class: typeof value === 'number' ? 'number' : null}, text(value));
  }

  /** Any JSON value: lists of objects as tables, objects as lists of keys. */
  function any(value) {
    if (plain(value)) return element('span', {}, text(value));
    if (Array.isArray(value)) {
      if (value.length === 0) return element('p', {class: 'dim'}, 'none');
      if (value.every(plain)) return element('ul', {}, value.map(item => element('li', {}, text(item))));
      const rows = value.map(item => plain(item) ? {value: item} : flat(item));
      const columns = [...new Set(rows.flatMap(row => Object.keys(row)))];
      const inner = value.map(item => Object.entries(item).filter(([, v]) => Array.isArray(v) && v.length));
      return element('div', {},
        element('div', {class: 'scroll'}, element('table', {},
          element('thead', {}, element('tr', {}, columns.map(key => element('th', {scope: 'col'}, label(key))))),
          element('tbody', {}, rows.map(row => element('tr', {}, columns.map(key => cell(row[key]))))))),
        inner.flatMap((lists, i) => lists.map(([key, list]) => element('div', {},
          element('h3', {}, `${text(value[i].name ?? i + 1)}: ${label(key)}`), any(list)))));
    }
    const parts = Object.entries(value);
    return element('div', {},
      element('table', {}, element('tbody', {}, parts.filter(([, v]) => plain(v)).map(([key, v]) =>
        element('tr', {}, element('th', {scope: 'row'}, label(key)), cell(v))))),
      parts.filter(([, v]) => !plain(v)).map(([key, v]) => element('div', {}, element('h3', {}, label(key)), any(v))));
  }

  /**
   * A table that its head sorts.
   * @param columns [{name, value(row), show(row) (an element or text), number}]
   * @returns {element, rows(list), mark(row)}
   */
  function sortable(columns, onPick) {
    let rows = [], order = {column: null, down: false};
    const body = element('tbody');
    const lines = new Map();
    const heads = columns.map((column, i) => element('th', {scope: 'col', class: column.number ? 'number' : null},
      element('button', {type: 'button', click: () => sort(i)}, column.name)));
    function compare(a, b) {
      const of = columns[order.column].value, x = of(a), y = of(b);
      const empty = (x === null || x === undefined) - (y === null || y === undefined);
      if (empty) return empty;
      const sign = typeof x === 'number' && typeof y === 'number' ? x - y : String(x).localeCompare(String(y), 'en', {numeric: true});
      return order.down ? -sign : sign;
    }
    function sort(i) {
      order = {column: i, down: order.column === i ? !order.down : !!columns[i].number};
      heads.forEach((head, k) => head.setAttribute('aria-sort', k !== i ? 'none' : order.down ? 'descending' : 'ascending'));
      draw();
    }
    function draw() {
      const sorted = order.column === null ? rows : [...rows].sort(compare);
      lines.clear();
      body.replaceChildren(...sorted.map(row => {
        const line = element('tr', {click: () => onPick && onPick(row)}, columns.map(column => {
          const shown = column.show ? column.show(row) : column.value(row);
          return shown instanceof Node ? element('td', {}, shown) : cell(shown);
        }));
        lines.set(row, line);
        return line;
      }));
    }
    return {
      element: element('div', {class: 'scroll study'}, element('table', {}, element('thead', {}, element('tr', {}, heads)), body)),
      rows(list) { rows = list; draw(); },
      mark(row) {
        for (const [other, line] of lines) line.classList.toggle('chosen', other === row);
        if (lines.has(row)) lines.get(row).scrollIntoView({block: 'nearest'});
      },
    };
  }

  return {text, label, flat, any, sortable};
})();

/** Numbers of a base64 text. */
function floats(base64) { return new Float32Array(bytesOf(base64)); }
function words(base64) { return new Uint16Array(bytesOf(base64)); }
function bytesOf(base64) {
  const text = atob(base64), out = new Uint8Array(text.length);
  for (let i = 0; i < text.length; ++i) out[i] = text.charCodeAt(i);
  return out.buffer;
}

/** Index of the last time that is not after t; 0 before all. */
function rowAt(times, t) {
  let low = 0, high = times.length - 1;
  while (low < high) {
    const middle = (low + high + 1) >> 1;
    if (times[middle] <= t) low = middle; else high = middle - 1;
  }
  return low;
}
