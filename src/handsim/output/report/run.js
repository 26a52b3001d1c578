// The page of a run, or of two: puts view, time line, curves, verdicts and tables together.
'use strict';

(() => {
  const data = JSON.parse(document.getElementById('data').textContent);
  const [main, other] = data.runs, summary = main.summary;
  const fingers = ['thumb', 'index', 'middle', 'ring', 'little', 'palm'];
  const css = list => '#' + list.map(c => Math.round(255 * (c <= 0.0031308 ? 12.92 * c : 1.055 * c ** (1 / 2.4) - 0.055)).toString(16).padStart(2, '0')).join('');
  const partColour = {};
  // Nails and the like have tints of their own.
  for (const shape of main.scene.shapes) if (!shape.mark) partColour[shape.part] = css(shape.colour);
  partColour.palm = '#8a6f52';

  const words = {held: ['✓ held', 'held'], failed: ['✗ FAILED', 'failed'], 'not measured': ['? NOT MEASURED', 'open'],
    'not judged': ['not judged', 'none'], diverged: ['✗ DIVERGED', 'failed']};
  const badge = verdict => {
    const [text, style] = words[verdict] || [verdict, 'none'];
    return element('span', {class: style + (style === 'none' ? '' : ' badge')}, text);
  };

  // Time: one clock for view, curves and tables.
  const state = {time: 0, playing: false, speed: 1, from: 0};
  const speeds = [0.01, 0.02, 0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10];
  const every = main.poses.every;
  let view = null, start = 0, end = 1;
  const plots = [], span = [0, 1];

  function seek(t, keep) {
    state.time = Math.min(end, Math.max(start, t));
    if (!keep) play(false);
    slider.value = state.time;
    slider.setAttribute('aria-valuetext', timeText());
    clock.textContent = timeText();
    if (view) view.seek(state.time);
    for (const plot of plots) plot.cursor(state.time);
    tell();
  }
  const timeText = () => `${state.time.toFixed(every < 1e-3 ? 4 : 3)} s of ${end.toFixed(3)} s`;
  function play(on) {
    if (on && state.time >= end - 1e-9) seek(start, true);
    state.playing = on;
    if (view) view.moving(on);
    last = null;
    playButton.textContent = on ? '❚❚ pause' : '▶ play';
  }
  const step = frames => seek((Math.round(state.time / every) + frames) * every);
  function setSpeed(speed) { state.speed = speed; speedBox.value = speed; }
  const faster = by => setSpeed(speeds[Math.min(speeds.length - 1, Math.max(0, speeds.indexOf(state.speed) + by))]);
  let last = null;
  function tick(now) {
    if (state.playing && last !== null) {
      const t = state.time + Math.min(0.25, (now - last) / 1000) * state.speed;
      seek(t, true);
      if (t >= end) play(false);
    }
    last = now;
    if (view) view.render();
    requestAnimationFrame(tick);
  }

  // The body that a place of a verdict names: a joint's child, a body, or a shape's body.
  function bodyOf(where) {
    const axis = main.scene.axes.find(a => where.startsWith(a.name.slice(0, a.name.lastIndexOf('.'))));
    const longest = main.scene.bodies.map((b, i) => [b.name, i]).filter(([name]) => where.startsWith(name)).sort((a, b) => b[0].length - a[0].length)[0];
    if (longest) return longest[1];
    if (axis) return axis.body;
    const shape = main.scene.shapes.find(s => where.includes(s.name));
    return shape ? shape.body : null;
  }
  function jump(t, where) {
    seek(t);
    if (view && where) { view.select(bodyOf(where)); tell(); }
  }

  /** Figures of the picked body. */
  function tell() {
    const body = view ? view.picked() : null;
    if (body === null) { label.textContent = ''; return; }
    const {name, mass} = main.scene.bodies[body], lines = [`${name}: ${mass === null ? 'fixed or driven' : mass < 0.1 ? Table.text(1e3 * mass) + ' g' : Table.text(mass) + ' kg'}, ${Table.text(+view.speed(body).toPrecision(3))} m/s`];
    if (view.hasContacts) {
      const list = view.contactsOf(body);
      lines.push(`${list.length} contact${list.length === 1 ? '' : 's'}`);
      const sums = new Map();
      for (const c of list) {
        const name = (c.a.body === body ? c.b : c.a).name;
        sums.set(name, (sums.get(name) || 0) + Math.hypot(...c.force));
      }
      for (const [name, force] of [...sums].slice(0, 8)) lines.push(`  ${name}: ${force.toPrecision(3)} N`);
    }
    label.textContent = lines.join('\n');
  }

  // Elements.
  const label = element('div', {class: 'label', 'aria-live': 'polite'}), legend3d = element('div', {class: 'legend3d'});
  const screen = element('div', {class: 'screen'}, label, legend3d);
  const clock = element('span', {class: 'time'});
  const playButton = element('button', {type: 'button', id: 'play', click: () => play(!state.playing)}, '▶ play');
  const speedBox = element('select', {'aria-label': 'speed', change: () => { state.speed = +speedBox.value; }},
    speeds.map(s => element('option', {value: s}, s < 1 ? `1/${Math.round(1 / s)} speed` : `${s} × speed`)));
  const slider = element('input', {type: 'range', id: 'time', step: 'any', 'aria-label': 'time', input: () => seek(+slider.value)});
  const marks = element('div', {class: 'marks'}), track = element('div', {class: 'track'}, marks, slider);

  const toggles = [['points', 'contact points', 'c'], ['forces', 'forces', 'f'], ['axes', 'joint axes', 'a'], ['trails', 'fingertip trails', 't'],
    ['ghost', 'other run', 'g'], ['floor', 'floor', null], ['colours', 'colours of fingers', 'n']];
  const boxes = {};
  function toggle(layer) {
    boxes[layer].checked = !boxes[layer].checked;
    view.show(layer, boxes[layer].checked);
  }
  // What one sees of hands. Contact is between the shapes, whatever is seen.
  const looks = ['skin', 'shapes', 'both'];
  const lookBox = element('select', {'aria-label': 'hands as skin, shapes or both (s)', change: () => setLook(lookBox.value)}, looks.map(l => element('option', {}, l)));
  function setLook(look) {
    if (view && view.hasSkin) view.setLook(look);
    lookBox.value = view ? view.look() : look;
    legend3d.textContent = view ? [view.forceScale ? `forces: ${Table.text(1e3 * view.forceScale)} mm for 1 N` : '',
      view.hasContacts && view.hasSkin && view.look() !== 'shapes' ? 'contact is with the shapes under the skin' : '',
      main.scene.ground !== null && main.scene.floor_is_drawn_only ? 'the floor is only drawn' : ''].filter(Boolean).join('; ') : '';
  }
  function layerBoxes() {
    const parts = [...new Set(main.scene.shapes.map(shape => shape.part))], hands = [...new Set(main.scene.shapes.map(shape => shape.hand).filter(Boolean))];
    const check = (text, on, change, colour) => {
      const box = element('input', {type: 'checkbox', change: () => change(box.checked)});
      box.checked = on;
      const swatch = colour && element('span', {class: 'swatch'});
      if (swatch) swatch.style.background = colour;
      return [element('label', {}, box, swatch, text), box];
    };
    const out = [];
    for (const [layer, text, key] of toggles) {
      if (layer === 'ghost' && !other) continue;
      if ((layer === 'points' || layer === 'forces') && !view.hasContacts) continue;
      if (layer === 'colours' && !view.hasSkin) continue;
      if (layer === 'axes' && !main.scene.axes.length || layer === 'trails' && !main.scene.tips.length) continue;
      const [line, box] = check(key ? `${text} (${key})` : text, view.isShown(layer), on => view.show(layer, on));
      boxes[layer] = box;
      out.push(line);
    }
    if (hands.length > 1) for (const hand of hands) out.push(check(`${hand} hand`, true, on => view.hideHand(hand, !on))[0]);
    for (const part of parts) out.push(check(part, true, on => view.hidePart(part, !on), css(main.scene.shapes.find(s => s.part === part).colour))[0]);
    if (view.followsHand) out.push(check('follow the hand', true, on => view.followHand(on))[0]);
    out.push(check('follow the picked body', false, on => view.follow(on))[0]);
    return out;
  }

  function timeLine() {
    const place = t => `${100 * (t - start) / (end - start || 1)}%`, out = [];
    for (const mark of main.marks.filter(m => m.kind === 'phase' && m.time < end)) {
      const phase = element('span', {class: 'phase', title: `${mark.name}, ${mark.time.toFixed(2)} to ${mark.end.toFixed(2)} s`}, mark.name.replace('_', ' '));
      phase.style.left = place(mark.time);
      phase.style.width = `${100 * (Math.min(end, mark.end) - mark.time) / (end - start || 1)}%`;
      out.push(phase);
    }
    const events = summary.criteria.filter(c => Number.isFinite(c.time_s) && c.measured !== null).map(c => ({time: c.time_s, where: c.where, bad: c.verdict === 'failed',
      name: `${c.name} ${Table.text(c.measured)} ${c.unit} at ${c.time_s.toFixed(3)} s, ${c.where}: ${c.verdict}`}));
    for (const mark of main.marks.filter(m => m.kind !== 'phase')) events.push({time: mark.time, where: mark.name, bad: true, name: mark.name});
    for (const event of events.sort((a, b) => a.bad - b.bad)) {
      const button = element('button', {type: 'button', class: event.bad ? 'failed' : null, title: event.name, 'aria-label': event.name,
        tabindex: event.bad ? null : '-1', click: () => jump(event.time, event.where)}, event.bad ? '▼' : '▾');
      button.style.left = place(event.time);
      out.push(button);
    }
    marks.replaceChildren(...out);
  }

  function verdicts() {
    const rows = summary.criteria.map(c => {
      const second = other && other.summary.criteria.find(o => o.name === c.name);
      const measured = x => x === undefined || x === null || x.measured === null ? '–' : `${Table.text(x.measured)} ${x.unit}`;
      const at = Number.isFinite(c.time_s) && c.measured !== null
        ? element('button', {type: 'button', class: 'link', 'data-time': c.time_s, click: () => jump(c.time_s, c.where)}, `${c.time_s.toFixed(3)} s, ${c.where}`) : '';
      return element('tr', {class: c.verdict === 'failed' ? 'bad' : null}, element('th', {scope: 'row'}, c.name), element('td', {}, badge(c.verdict)), element('td', {class: 'number'}, measured(c)),
        element('td', {class: 'number'}, c.limit == null ? '–' : `${c.limit_is === 'least' ? '≥' : '≤'} ${Table.text(c.limit)} ${c.unit}`), element('td', {}, at),
        other ? [element('td', {class: 'number'}, measured(second)), element('td', {}, second ? badge(second.verdict) : '')] : null);
    });
    const heads = ['criterion', 'verdict', 'measured', 'limit', 'where: click to go there', ...(other ? ['other run', 'its verdict'] : [])];
    return element('section', {id: 'verdicts'}, element('h2', {}, 'Verdicts'),
      element('div', {class: 'scroll'}, element('table', {}, element('thead', {}, element('tr', {}, heads.map(h => element('th', {scope: 'col'}, h)))), element('tbody', {}, rows))));
  }

  /** Warnings and faults in front of all else. */
  function troubles() {
    const list = [];
    if (summary.fault) list.push(`Diverged at ${summary.fault.time_s} s: ${summary.fault.where}, ${summary.fault.quantity}: ${summary.fault.detail}`);
    list.push(...(summary.missing || []).filter(m => !m.startsWith('pictures: not') && !m.startsWith('plots: not')).map(m => `Missing: ${m}`));
    list.push(...((summary.convergence || {}).warnings || []), ...(summary.warnings || []));
    return list.length ? element('section', {}, element('h2', {class: 'failed'}, 'Warnings'), element('ul', {}, list.map(text => element('li', {}, text)))) : null;
  }

  function curves() {
    const groups = new Map(), muscles = new Map(), partOf = name => muscles.get(name) || fingers.find(f => name.includes(f));
    data.runs.forEach((run, r) => {
      for (const curve of run.curves) {
        if (!groups.has(curve.group)) groups.set(curve.group, {unit: curve.unit.replace('um', 'µm'), list: [], count: {}});
        const group = groups.get(curve.group), part = fingers.find(f => curve.name.includes(f));
        // A muscle's name does not have its finger; its kind does.
        if (!['value', 'target'].includes(curve.kind)) muscles.set(curve.name, curve.kind);
        if (!(curve.name in group.count)) group.count[curve.name] = Object.keys(group.count).length;
        const colour = part ? partColour[part] || Curves.palette[7] : Curves.palette[group.count[curve.name] % Curves.palette.length];
        group.list.push({name: curve.name, times: floats(curve.times), values: floats(curve.values), colour,
          dash: curve.kind === 'target' ? [5, 4] : r ? [2, 2] : [], width: curve.kind === 'target' ? 1 : 1.5, faint: r > 0});
      }
    });
    const out = element('section', {class: 'plots', tabindex: '0', 'aria-label': 'curves'});
    const names = [...new Set(main.curves.map(c => c.name))];
    const parts = fingers.filter(f => names.some(n => partOf(n) === f)), hands = [...new Set(names.map(n => n.split('.')[0]))].filter(h => main.scene.shapes.some(s => s.hand === h));
    const finger = element('select', {'aria-label': 'curves of this finger', change: filter}, element('option', {value: ''}, 'all fingers'), parts.map(p => element('option', {}, p)));
    const hand = element('select', {'aria-label': 'curves of this hand', change: filter}, element('option', {value: ''}, 'all hands'), hands.map(p => element('option', {}, p)));
    function filter() {
      for (const plot of plots) plot.only(name => (!finger.value || [finger.value, undefined].includes(partOf(name))) &&
        (!hand.value || name.startsWith(hand.value + '.') || !hands.some(h => name.startsWith(h + '.'))));
    }
    const zoom = factor => {
      const width = Math.min(end - start, (span[1] - span[0]) * factor), from = Math.min(Math.max(start, state.time - width / 2), end - width);
      span[0] = from;
      span[1] = from + width;
      for (const plot of plots) plot.update();
    };
    const bar = element('div', {class: 'bar'}, parts.length > 1 ? finger : null, hands.length > 1 ? hand : null,
      element('button', {type: 'button', title: 'a third of the time, around the cursor', click: () => zoom(1 / 3)}, 'zoom in'),
      element('button', {type: 'button', click: () => zoom(3)}, 'zoom out'));
    if (groups.size) out.append(bar);
    for (const [title, group] of groups) {
      const plot = Curves.plot(title, group.unit, group.list, span, t => seek(t));
      plots.push(plot);
      out.append(plot.element);
    }
    const notes = [];
    if (main.curves.some(c => c.kind === 'target')) notes.push('dashed: targets');
    if (other) notes.push('faint, dotted: the other run');
    out.append(element('p', {class: 'dim'}, [...notes, 'A click or drag in a plot goes to that time; a click on a name hides its curve.'].join('. ')));
    return out;
  }

  function sections() {
    const has = (key, title) => summary[key] === undefined || Array.isArray(summary[key]) && !summary[key].length ? null :
      element('details', {open: key === 'grasps' || key === 'climbs'}, element('summary', {}, title), Table.any(summary[key]));
    const download = element('button', {type: 'button', class: 'screenonly', click: () => {
      const link = element('a', {href: URL.createObjectURL(new Blob([main.resolved], {type: 'text/yaml'})), download: 'resolved.yaml'});
      link.click();
      setTimeout(() => URL.revokeObjectURL(link.href), 1000);
    }}, 'save as resolved.yaml');
    return [
      element('section', {}, element('h2', {}, 'Figures'), has('grasps', 'Grasps'), has('climbs', 'Climbs'), has('control', 'Control'),
        has('contact_forces', 'Contact forces'), has('convergence', 'Convergence'), has('steps', 'Steps by method'), has('counts', 'Counts'),
        has('time', 'Time'), has('ledger', 'Cost ledger'), has('notes', 'Notes of the engine'), has('overlaps_at_start', 'Overlaps at the start'),
        has('solver', 'Solver'), has('versions', 'Versions')),
      element('section', {}, element('h2', {}, 'Repeat it'), element('p', {}, element('code', {}, main.command)),
        element('p', {class: 'dim'}, 'The same build gives the same bits; another state hash ends with exit status 1.'),
        element('details', {}, element('summary', {}, 'Resolved scene'), download, element('pre', {}, main.resolved))),
      element('section', {}, element('h2', {}, 'What this page shows'), element('p', {class: 'dim'}, dataText())),
    ];
  }

  function dataText() {
    const kept = run => `${floats(run.poses.times).length} of ${run.poses.recorded} recorded rows (one every ${Table.text(1e3 * run.poses.every)} ms) are kept: a straight line between two of them passes every recorded pose within ${Table.text(1e3 * run.poses.tolerance)} mm.`;
    let text = data.runs.map((run, i) => (i ? 'Other run: ' : 'Poses: ') + kept(run)).join(' ') + ' Curves are kept within 1/500 of their range. Numbers are float32; trajectory.csv in the run\'s folder has all digits.';
    if (main.contacts && main.contacts.stride > 1) text += ` Contacts are those of one in ${main.contacts.stride} recorded rows.`;
    if (main.zero.length) text += ` All zero and not drawn: ${main.zero.join('; ').toLowerCase()}.`;
    if (main.scene.skins.length) text += ' Skin is for the eye: it follows from the shapes, which are what touches and what has mass.';
    if (!main.contacts) text += ' The run recorded no contacts (record.contacts, or run with --report).';
    return text + ' The page needs no network. Without WebGL the 3D view is missing, all else is there; printed, it has the view and curves at the present time.';
  }

  function help() {
    const keys = [['Space', 'play, pause'], ['← →', 'a recorded frame back, on'], ['Shift ← →', 'ten frames'], ['Home End', 'start, end'], ['↑ ↓', 'faster, slower'],
      ['c f a t g n', 'contact points, forces, joint axes, trails, other run, colours of fingers'], ['s', 'hands as skin, shapes or both'], ['r', 'camera of the pictures'], ['+ −', 'zoom'], ['Alt arrows', 'orbit']];
    return element('details', {class: 'screenonly'}, element('summary', {}, 'Keys and mouse'), element('table', {}, element('tbody', {}, keys.map(([k, text]) =>
      element('tr', {}, element('td', {}, element('kbd', {}, k)), element('td', {}, text))))),
    element('p', {class: 'dim'}, 'Drag: orbit. Shift-drag, right button or two fingers: pan. Wheel or pinch: zoom. Click a body: its mass, speed and contacts.'));
  }

  function onKey(event) {
    if (event.ctrlKey || event.metaKey) return;
    const of = event.target, typing = /^(SELECT|TEXTAREA)$/.test(of.tagName) || of.tagName === 'INPUT' && of.type === 'text';
    const onButton = /^(BUTTON|SUMMARY|A)$/.test(of.tagName) || of.tagName === 'INPUT' && of.type === 'checkbox';
    if (typing || (event.key === ' ' || event.key === 'Enter') && onButton) return;
    const frames = event.shiftKey ? 10 : 1;
    const turn = (x, y) => view && view.orbit.turn(x, y);
    const alt = {ArrowLeft: () => turn(-0.1, 0), ArrowRight: () => turn(0.1, 0), ArrowUp: () => turn(0, -0.1), ArrowDown: () => turn(0, 0.1)};
    const plain = {' ': () => play(!state.playing), ArrowLeft: () => step(-frames), ArrowRight: () => step(frames), Home: () => seek(start), End: () => seek(end),
      ArrowUp: () => faster(1), ArrowDown: () => faster(-1), r: () => view && view.reset(), s: () => view && setLook(looks[(looks.indexOf(view.look()) + 1) % 3]), '+': () => view && view.orbit.zoom(0.9), '-': () => view && view.orbit.zoom(1.1)};
    for (const [layer, , key] of toggles) if (key && boxes[layer]) plain[key] = () => toggle(layer);
    const action = (event.altKey ? alt : plain)[event.key];
    // Up and down scroll the page unless the view or the time line has the focus.
    if (!action || (/^Arrow(Up|Down)$/.test(event.key) && !event.altKey && of.tagName !== 'CANVAS' && of !== slider)) return;
    event.preventDefault();
    action();
  }

  const simulated = summary.time ? `${Table.text(summary.time.simulated_s)} s, simulated in ${Table.text(+summary.time.loop_wall_s.toPrecision(3))} s` : '';
  document.body.append(
    element('header', {}, element('h1', {}, main.title, ' ', badge(summary.verdict)),
      element('p', {class: 'dim'}, `${main.name}: ${simulated}; ${summary.solver.engine}, ${summary.solver.method}, step ${Table.text(1e3 * summary.solver.step_s)} ms; handsim ${summary.versions.handsim}`),
      other ? element('p', {class: 'dim'}, `ghost, other run: ${other.name}: ${other.title}, `, badge(other.summary.verdict)) : null),
    element('main', {},
      element('div', {class: 'stage'},
        element('div', {class: 'view'}, screen, track,
          element('div', {class: 'bar'}, playButton, element('button', {type: 'button', 'aria-label': 'a frame back', click: () => step(-1)}, '◂|'),
            element('button', {type: 'button', 'aria-label': 'a frame on', click: () => step(1)}, '|▸'), speedBox, lookBox,
            element('button', {type: 'button', click: () => view && view.reset()}, 'reset camera'), clock),
          element('div', {class: 'parts', id: 'layers'}), help()),
        curves()),
      troubles(), verdicts(), sections()));

  try {
    view = Scene.create(screen, data.runs, () => tell());
  } catch (error) {
    screen.append(element('p', {class: 'message'}, 'This browser has no WebGL, so there is no 3D view. Curves, verdicts and tables are complete.'));
  }
  start = view ? view.start : 0;
  end = view ? view.end : Math.max(...main.curves.map(c => { const t = floats(c.times); return t[t.length - 1]; }), 1e-3);
  span[0] = start;
  span[1] = end > start ? end : start + 1e-3;
  slider.min = start;
  slider.max = end;
  if (view) {
    document.getElementById('layers').append(...layerBoxes());
    lookBox.hidden = !view.hasSkin;
    setLook(view.look());
  }
  timeLine();
  setSpeed(1);
  for (const plot of plots) plot.update();
  seek(start);
  document.addEventListener('keydown', onKey);
  window.addEventListener('beforeprint', () => { for (const details of document.querySelectorAll('section details')) details.open = !details.querySelector('pre'); });
  requestAnimationFrame(tick);
  /** For tests and scripts in the browser's console. */
  window.handsimReport = {state, seek, view, data};
})();
