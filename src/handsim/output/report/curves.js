// Plots on a canvas: curves over time with a cursor that the page shares, and a scatter plot of a table.
'use strict';

const Curves = (() => {
  const ink = '#1d232a', dim = '#59636e', grid = '#e3e7eb';

  /** Round numbers between two bounds, about `count` of them. */
  function ticks(low, high, count) {
    const rough = (high - low) / Math.max(1, count), decade = 10 ** Math.floor(Math.log10(rough)), share = rough / decade;
    const step = decade * (share > 5 ? 10 : share > 2 ? 5 : share > 1 ? 2 : 1), out = [];
    for (let k = Math.ceil(low / step - 1e-9); k * step <= high + 1e-9 * step; ++k) out.push(k * step);
    return out;
  }
  function tickText(value, step) {
    if (Math.abs(value) < 1e-12 * Math.abs(step) || value === 0) return '0';
    const size = Math.abs(value);
    if (size >= 1e5 || size < 1e-3) return value.toExponential(1).replace('.0e', 'e');
    return String(+value.toFixed(Math.max(0, 1 - Math.floor(Math.log10(Math.abs(step || value))))));
  }

  /** A canvas of the size of its box in real pixels. */
  function surface(canvas) {
    const ratio = window.devicePixelRatio || 1, width = canvas.clientWidth, height = canvas.clientHeight;
    if (canvas.width !== Math.round(width * ratio) || canvas.height !== Math.round(height * ratio)) {
      canvas.width = Math.round(width * ratio);
      canvas.height = Math.round(height * ratio);
    }
    const draw = canvas.getContext('2d');
    draw.setTransform(ratio, 0, 0, ratio, 0, 0);
    draw.clearRect(0, 0, width, height);
    draw.font = '11px system-ui, "DejaVu Sans", sans-serif';
    return {draw, width, height};
  }

  /** Axes with grid lines; returns the functions from values to pixels. */
  function frame(draw, box, x, y, texts) {
    const toX = v => box.left + (v - x[0]) / (x[1] - x[0]) * box.width, toY = v => box.top + box.height - (v - y[0]) / (y[1] - y[0]) * box.height;
    draw.fillStyle = dim;
    draw.strokeStyle = grid;
    draw.lineWidth = 1;
    draw.beginPath();
    const xs = ticks(x[0], x[1], box.width / 70), ys = ticks(y[0], y[1], box.height / 32);
    for (const v of xs) { draw.moveTo(toX(v), box.top); draw.lineTo(toX(v), box.top + box.height); }
    for (const v of ys) { draw.moveTo(box.left, toY(v)); draw.lineTo(box.left + box.width, toY(v)); }
    draw.stroke();
    draw.textAlign = 'center';
    for (const v of xs) draw.fillText(texts.x ? texts.x(v) : tickText(v, xs[1] - xs[0]) + (texts.unit || ''), toX(v), box.top + box.height + 14);
    draw.textAlign = 'right';
    for (const v of ys) draw.fillText(texts.y ? texts.y(v) : tickText(v, ys[1] - ys[0]), box.left - 5, toY(v) + 4);
    draw.textAlign = 'left';
    return {toX, toY};
  }

  /** The value of a curve between its kept rows; nothing outside. */
  function valueAt(curve, t) {
    const {times, values} = curve;
    if (!times.length || t < times[0] - 1e-6 || t > times[times.length - 1] + 1e-6) return null;
    const row = rowAt(times, t);
    if (row + 1 >= times.length) return values[row];
    const share = Math.min(1, Math.max(0, (t - times[row]) / (times[row + 1] - times[row])));
    return values[row] + share * (values[row + 1] - values[row]);
  }

  /**
   * A plot of the curves of one unit.
   * @param title name and unit. @param curves [{name, times, values, colour, dash, width, faint}], with a band around it {low, high}
   * @param span [start, end] of the time axis, changed by the page. @param onTime(t) a place was clicked.
   */
  function plot(title, unit, curves, span, onTime) {
    const canvas = element('canvas', {role: 'img', tabindex: '0', 'aria-label': `${title} in ${unit || 'numbers'} over time; a click goes to that time`});
    const keys = element('div', {class: 'keys'}), hidden = new Set();
    const names = [...new Set(curves.map(curve => curve.name))];
    const labels = names.map(name => {
      const of = curves.filter(c => c.name === name), curve = of.find(c => !c.dash || !c.dash.length) || of[0], value = element('span', {class: 'dim'});
      const mark = element('i', {}), button = element('button', {type: 'button', 'aria-pressed': 'true', click: () => {
        hidden[hidden.has(name) ? 'delete' : 'add'](name);
        button.setAttribute('aria-pressed', String(!hidden.has(name)));
        update();
      }}, mark, name, value);
      mark.style.borderColor = curve.colour;
      mark.style.borderTopStyle = curve.dash && curve.dash.length ? 'dashed' : 'solid';
      return {name, button, mark, value, curves: of};
    });
    keys.append(...labels.map(l => l.button));
    let filter = () => true, box = null, time = 0;
    /** What is no more than rounding beside the plot's values is 0. */
    const least = 1e-9 * curves.reduce((most, curve) => curve.values.reduce((a, v) => Math.max(a, Math.abs(v)), most), 0);
    const shown = () => curves.filter(curve => !hidden.has(curve.name) && filter(curve.name));

    function range(list) {
      let low = Infinity, high = -Infinity;
      for (const {times, values, low: under = values, high: over = values} of list)
        for (let i = 0; i < times.length; ++i) {
          if (times[i] < span[0] && i + 1 < times.length && times[i + 1] < span[0]) continue;
          if (times[i] > span[1] && i > 0 && times[i - 1] > span[1]) break;
          low = Math.min(low, under[i]);
          high = Math.max(high, over[i]);
        }
      if (!(high >= low)) return [0, 1];
      const spare = high > low ? 0.06 * (high - low) : Math.max(1e-12, 0.1 * Math.abs(high)) || 1;
      return [low - spare, high + spare];
    }
    // The curves are drawn once; the cursor over a copy of them.
    const behind = element('canvas');
    function update() {
      const {draw, width, height} = surface(canvas);
      if (width < 60) return;
      box = {left: 52, top: 8, width: width - 62, height: height - 30};
      const list = shown(), y = range(list), {toX, toY} = frame(draw, box, span, y, {unit: ' s'});
      draw.save();
      draw.beginPath();
      draw.rect(box.left, box.top, box.width, box.height);
      draw.clip();
      draw.lineJoin = 'round';
      for (const curve of list.filter(c => c.low)) {
        draw.fillStyle = curve.shown || curve.colour;
        draw.globalAlpha = 0.2;
        draw.beginPath();
        curve.times.forEach((t, i) => draw.lineTo(toX(t), toY(curve.low[i])));
        for (let i = curve.times.length; i-- > 0;) draw.lineTo(toX(curve.times[i]), toY(curve.high[i]));
        draw.fill();
      }
      for (const curve of list) {
        draw.strokeStyle = curve.shown || curve.colour;
        draw.globalAlpha = curve.faint ? 0.5 : 1;
        draw.lineWidth = curve.width || 1.5;
        draw.setLineDash(curve.dash || []);
        draw.beginPath();
        let first = Math.max(0, rowAt(curve.times, span[0]));
        for (let i = first; i < curve.times.length; ++i) {
          draw[i === first ? 'moveTo' : 'lineTo'](toX(curve.times[i]), toY(curve.values[i]));
          if (curve.times[i] > span[1]) break;
        }
        draw.stroke();
      }
      draw.restore();
      behind.width = canvas.width;
      behind.height = canvas.height;
      behind.getContext('2d').drawImage(canvas, 0, 0);
      cursor(time);
    }
    function cursor(t) {
      time = t;
      if (!box) return;
      const draw = canvas.getContext('2d'), ratio = window.devicePixelRatio || 1;
      draw.setTransform(1, 0, 0, 1, 0, 0);
      draw.clearRect(0, 0, canvas.width, canvas.height);
      draw.drawImage(behind, 0, 0);
      draw.setTransform(ratio, 0, 0, ratio, 0, 0);
      const x = box.left + (t - span[0]) / (span[1] - span[0]) * box.width;
      if (x >= box.left - 1 && x <= box.left + box.width + 1) {
        draw.strokeStyle = ink;
        draw.lineWidth = 1;
        draw.beginPath();
        draw.moveTo(x, box.top);
        draw.lineTo(x, box.top + box.height);
        draw.stroke();
      }
      for (const label of labels) {
        const values = label.curves.map(c => valueAt(c, t)).filter(v => v !== null);
        const digits = v => Table.text(Math.abs(v) < least ? 0 : +v.toPrecision(3)), of = label.curves[0], end = side => valueAt({times: of.times, values: of[side]}, t);
        label.value.textContent = values.map(digits).join(' / ') + (of.low && values.length ? ` (${digits(end('low'))} to ${digits(end('high'))})` : '');
      }
    }
    function pick(event) {
      const left = canvas.getBoundingClientRect().left, share = (event.clientX - left - box.left) / box.width;
      onTime(span[0] + Math.min(1, Math.max(0, share)) * (span[1] - span[0]));
    }
    canvas.addEventListener('pointerdown', event => { if (event.button === 0 && box) { canvas.setPointerCapture(event.pointerId); pick(event); } });
    canvas.addEventListener('pointermove', event => { if ((event.buttons & 1) && box) pick(event); });
    new ResizeObserver(update).observe(canvas);
    const whole = element('section', {class: 'plot'}, element('h3', {}, unit ? `${title} (${unit})` : title), canvas, keys);
    return {
      element: whole,
      update, cursor,
      /** Shows only curves of names that pass. */
      only(test) {
        filter = test;
        const names = labels.filter(label => test(label.name));
        // Few curves, such as those of one finger, get a colour each.
        const single = names.length < labels.length && names.length <= palette.length;
        for (const label of labels) {
          label.button.hidden = !test(label.name);
          label.curves.forEach(curve => { curve.shown = single && names.includes(label) ? palette[names.indexOf(label)] : curve.colour; });
          label.mark.style.borderColor = label.curves[0].shown;
        }
        whole.hidden = !names.length;
        update();
      },
    };
  }

  /** Points of a table. @param onPick(row) */
  function scatter(onPick) {
    const canvas = element('canvas', {class: 'scatter', role: 'img', 'aria-label': 'points of the table; a click picks a row'});
    let points = [], axes = {}, chosen = null, places = [];
    function scaled(log, values) {
      const good = values.filter(v => Number.isFinite(v) && (!log || v > 0)).map(v => log ? Math.log10(v) : v);
      if (!good.length) return [0, 1];
      const low = Math.min(...good), high = Math.max(...good), spare = high > low ? 0.05 * (high - low) : 0.5 * Math.max(Math.abs(high), 1e-9);
      return [low - spare, high + spare];
    }
    function update() {
      const {draw, width, height} = surface(canvas);
      if (width < 60) return;
      const box = {left: 66, top: 10, width: width - 80, height: height - 52};
      const x = scaled(axes.logX, points.map(p => p.x)), y = scaled(axes.logY, points.map(p => p.y));
      const power = v => Math.abs(v - Math.round(v)) < 1e-9 ? tickText(10 ** v, 10 ** v) : '';
      const {toX, toY} = frame(draw, box, x, y, {x: axes.logX && power, y: axes.logY && power});
      draw.fillStyle = ink;
      draw.textAlign = 'center';
      draw.fillText(axes.x || '', box.left + box.width / 2, height - 8);
      draw.save();
      draw.translate(12, box.top + box.height / 2);
      draw.rotate(-Math.PI / 2);
      draw.fillText(axes.y || '', 0, 0);
      draw.restore();
      places = [];
      const of = (log, v) => log ? Math.log10(v) : v;
      for (const pass of [false, true])
        for (const point of points) {
          if ((point.row === chosen) !== pass) continue;
          if (!Number.isFinite(point.x) || !Number.isFinite(point.y) || (axes.logX && point.x <= 0) || (axes.logY && point.y <= 0)) continue;
          const px = toX(of(axes.logX, point.x)), py = toY(of(axes.logY, point.y));
          places.push({px, py, row: point.row});
          symbol(draw, px, py, point.shape, pass ? 7 : points.length > 800 ? 2.5 : 4.5, point.colour, pass);
        }
    }
    canvas.addEventListener('click', event => {
      const box = canvas.getBoundingClientRect(), x = event.clientX - box.left, y = event.clientY - box.top;
      let best = null, nearest = 400;
      for (const place of places) {
        const d = (place.px - x) ** 2 + (place.py - y) ** 2;
        if (d < nearest) { nearest = d; best = place.row; }
      }
      if (best !== null) onPick(best);
    });
    new ResizeObserver(update).observe(canvas);
    return {
      element: canvas,
      /** @param list [{x, y, colour, shape, row}] @param names {x, y, logX, logY} */
      show(list, names) { points = list; axes = names; update(); },
      mark(row) { chosen = row; update(); },
      place: row => places.find(place => place.row === row),
    };
  }

  /** Groups differ in colour and in form. */
  function symbol(draw, x, y, shape, size, colour, ring) {
    draw.beginPath();
    if (shape % 4 === 1) draw.rect(x - size * 0.85, y - size * 0.85, 1.7 * size, 1.7 * size);
    else if (shape % 4 === 2) { draw.moveTo(x, y - size); draw.lineTo(x + size, y + 0.8 * size); draw.lineTo(x - size, y + 0.8 * size); draw.closePath(); }
    else if (shape % 4 === 3) { draw.moveTo(x, y - 1.2 * size); draw.lineTo(x + 1.1 * size, y); draw.lineTo(x, y + 1.2 * size); draw.lineTo(x - 1.1 * size, y); draw.closePath(); }
    else draw.arc(x, y, size, 0, 7);
    draw.globalAlpha = 0.8;
    draw.fillStyle = colour;
    draw.fill();
    draw.globalAlpha = 1;
    if (ring) { draw.strokeStyle = ink; draw.lineWidth = 2; draw.stroke(); }
  }

  /** Okabe & Ito (2008): apart for colour-blind people. */
  const palette = ['#0072b2', '#d55e00', '#009e73', '#cc79a7', '#b08900', '#56b4e9', '#5b3a8c', '#444c55'];
  return {plot, scatter, symbol, valueAt, palette};
})();
