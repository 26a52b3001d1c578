// The page of a live session: the report's view of the scene as it moves now, and what takes hold of it.
'use strict';

(() => {
  let data = JSON.parse(document.getElementById('data').textContent);
  // The report's view reads numbers from base64; here they are arrays that change under it.
  const fromText = {floats, words};
  floats = x => x instanceof Float32Array ? x : fromText.floats(x);
  words = x => x instanceof Uint16Array ? x : fromText.words(x);

  const MOST = 512, KEPT = 4096;
  const state = {playing: false, speed: 1, time: 0, start: 0, present: 0, verdicts: [], notices: [], numbers: {}, overrides: {}};
  let view = null, poses = null, angles = null, contacts = null, built = data.built, time = 0, springs = [], fresh = false;
  let socket = null, problem = '', views = 0, shownViews = 0;
  const latency = [];

  function send(what, values = {}) {
    if (socket && socket.readyState === WebSocket.OPEN) socket.send(JSON.stringify({do: what, ...values}));
  }

  // What comes in.
  function onView(buffer) {
    const head = new DataView(buffer), number = i => head.getUint16(i, true);
    const count = {bodies: number(16), contacts: number(18), angles: number(20), springs: number(22)};
    if (head.getUint32(24, true) !== built) return;
    time = head.getFloat64(8, true);
    let at = 32;
    const floatsOf = n => { const out = new Float32Array(buffer, at, n); at += 4 * n; return out; };
    const wordsOf = n => { const out = new Uint16Array(buffer, at, n); at += 2 * n; return out; };
    const pose = floatsOf(7 * count.bodies), touch = floatsOf(6 * count.contacts), q = floatsOf(count.angles), pulled = floatsOf(10 * count.springs);
    const bodies = wordsOf(count.bodies), shapes = wordsOf(2 * count.contacts), places = wordsOf(count.angles);
    if (!poses) {
      poses = new Float32Array(7 * data.scene.bodies.length);
      angles = new Float32Array(data.coordinates.length);
    }
    bodies.forEach((body, i) => poses.set(pose.subarray(7 * i, 7 * i + 7), 7 * body));
    places.forEach((place, i) => { angles[place] = q[i]; });
    springs = Array.from({length: count.springs}, (_, i) => pulled.subarray(10 * i, 10 * i + 10));
    if (!view) makeView();
    if (contacts && head.getUint32(28, true) & 1) {
      const n = Math.min(MOST, count.contacts);
      contacts.values.set(touch.subarray(0, 6 * n));
      contacts.shapes.set(shapes.subarray(0, 2 * n));
      contacts.starts[1] = n;
    }
    fresh = true;
    ++views;
    keepCurves();
  }

  function onText(message) {
    if (message.scene) {
      data = message;
      built = data.built;
      rebuild();
    } else if (message.problem) {
      problem = message.problem;
      tellNotices();
    } else if (message.state) {
      Object.assign(state, message.state);
      tell();
    }
  }

  function connect() {
    socket = new WebSocket(`ws://${location.host}/socket${location.search}`);
    socket.binaryType = 'arraybuffer';
    socket.onmessage = event => typeof event.data === 'string' ? onText(JSON.parse(event.data)) : onView(event.data);
    socket.onclose = () => { status.textContent = 'not connected: the session has ended, or too many pages are open'; status.className = 'status off'; setTimeout(connect, 3000); };
    socket.onopen = () => { status.className = 'status'; };
  }

  // The view.
  function makeView() {
    const moving = data.scene.bodies.map((_, i) => i);
    contacts = data.names.length ? {times: new Float32Array(1), starts: new Float32Array([0, MOST]), values: new Float32Array(6 * MOST),
      shapes: new Uint16Array(2 * MOST), names: data.names, largest: 20} : null;
    const scene = {...data.scene, camera: {...data.scene.camera, path: null}};
    view = Scene.create(screen, [{scene, poses: {moving, fixed: [], times: new Float32Array(1), values: poses}, contacts}], () => tellPicked());
    if (contacts) contacts.starts[1] = 0;
    view.moving(state.playing);
    legend3d.textContent = view.forceScale ? `forces: ${Table.text(1e3 * view.forceScale)} mm for 1 N` : '';
    layers.replaceChildren(...layerBoxes());
    lookBox.hidden = !view.hasSkin;
    if (view.hasSkin) lookBox.value = view.look();
  }

  /** After the scene was built anew: the camera stays. */
  function rebuild() {
    const old = view && {position: view.camera.position.clone(), target: view.orbit.target.clone()};
    if (view) view.canvas.remove();
    view = poses = null;
    pull.lines.length = 0;
    fill();
    restore = () => {
      if (!old) return;
      view.camera.position.copy(old.position);
      view.orbit.target.copy(old.target);
      view.orbit.place();
    };
  }
  let restore = null;

  const toggles = [['points', 'contact points', 'c'], ['forces', 'forces', 'f'], ['axes', 'joint axes', 'a'], ['floor', 'floor', null], ['colours', 'colours of fingers', 'n']];
  const looks = ['skin', 'shapes', 'both'];
  function setLook(look) { if (view && view.hasSkin) { view.setLook(look); lookBox.value = view.look(); } }
  const boxes = {};
  function layerBoxes() {
    const check = (text, on, change) => {
      const box = element('input', {type: 'checkbox', change: () => change(box.checked)});
      box.checked = on;
      return [element('label', {}, box, text), box];
    };
    const out = [];
    for (const [layer, text, key] of toggles) {
      if ((layer === 'points' || layer === 'forces') && !view.hasContacts || layer === 'axes' && !data.scene.axes.length || layer === 'colours' && !view.hasSkin) continue;
      const [line, box] = check(key ? `${text} (${key})` : text, view.isShown(layer), on => view.show(layer, on));
      boxes[layer] = box;
      out.push(line);
    }
    if (palms().length) out.push(check('follow the hands', follow.on, on => { follow.on = on; follow.last = null; })[0]);
    out.push(check('follow the picked body', false, on => view.follow(on))[0]);
    return out;
  }

  // The camera goes with the hands, a quarter of a second behind them.
  const follow = {on: true, last: null};
  const palms = () => data.scene.bodies.map((body, i) => body.name.endsWith('.palm') ? i : 0).filter(i => i);
  function resetCamera() {
    if (!view) return;
    view.reset();
    if (follow.start) follow.last = follow.start.clone();
  }
  function followHands() {
    const of = palms();
    if (!follow.on || !of.length) return;
    const now = new THREE.Vector3();
    for (const body of of) now.addScaledVector(view.bodies[body].position, 1 / of.length);
    if (!follow.last) { follow.last = now; follow.start = follow.start || now.clone(); return; }
    const by = now.sub(follow.last).multiplyScalar(1 - Math.exp(-(performance.now() - follow.time) / 250));
    follow.last.add(by);
    if (by.length() > 1e-6) view.orbit.shift(by);
  }

  function tick() {
    if (view) {
      if (restore) { restore(); restore = null; }
      if (fresh) {
        fresh = false;
        view.seek(0);
        drawSprings();
        tellPicked();
        shownViews = views;
      }
      if (pull.body === null) followHands();
      follow.time = performance.now();
      view.render();
      if (pull.since !== null && springs.length) {
        latency.push(performance.now() - pull.since);
        pull.since = null;
      }
      pull.flush();
    }
    requestAnimationFrame(tick);
  }

  // Pulling and pushing.
  const pull = {
    id: Math.floor(8 * Math.random()), body: null, point: null, goal: null, plane: new THREE.Plane(), ray: new THREE.Raycaster(), lines: [], since: null, sent: 0, due: false, force: 0,
    aim(event) {
      const box = view.canvas.getBoundingClientRect();
      this.ray.setFromCamera(new THREE.Vector2(2 * (event.clientX - box.left) / box.width - 1, 1 - 2 * (event.clientY - box.top) / box.height), view.camera);
    },
    hit(event) {
      this.aim(event);
      view.camera.updateMatrixWorld();
      const meshes = view.bodies.flatMap(group => group.children.filter(mesh => mesh.userData.shape && mesh.userData.shape.body > 0));
      return this.ray.intersectObjects(meshes)[0] || null;
    },
    begin(event) {
      if (!view || event.target !== view.canvas || event.button !== 0 || event.shiftKey || mode.value === 'orbit') return;
      const found = this.hit(event);
      if (!found) return;
      event.stopPropagation();
      const body = found.object.userData.shape.body;
      view.select(body);
      tellPicked();
      if (mode.value === 'push') {
        const along = this.ray.ray.direction.clone().multiplyScalar(+strength.value);
        send('push', {body, force: along.toArray(), time: 0.05});
        return;
      }
      view.canvas.setPointerCapture(event.pointerId);
      this.body = body;
      this.point = view.bodies[body].worldToLocal(found.point.clone());
      this.goal = found.point.clone();
      this.plane.setFromNormalAndCoplanarPoint(view.camera.getWorldDirection(new THREE.Vector3()), found.point);
      this.since = performance.now();
      this.due = true;
      this.flush();
    },
    move(event) {
      if (this.body === null) return;
      event.stopPropagation();
      this.aim(event);
      if (this.ray.ray.intersectPlane(this.plane, this.goal)) this.due = true;
      this.flush();
    },
    end(event) {
      if (this.body === null) return;
      if (event) event.stopPropagation();
      this.body = null;
      this.due = false;
      this.since = null;
      send('spring', {id: this.id, release: true});
    },
    flush() {
      const now = performance.now();
      if (!this.due || this.body === null || now - this.sent < 12) return;
      this.due = false;
      this.sent = now;
      send('spring', {id: this.id, body: this.body, point: this.point.toArray(), goal: this.goal.toArray(), stiffness: 150, force: +strength.value});
    },
  };

  function drawSprings() {
    while (pull.lines.length < springs.length) {
      const rod = new THREE.CylinderBufferGeometry(0.0011, 0.0011, 1, 8);
      rod.translate(0, 0.5, 0);
      const line = new THREE.Mesh(rod, new THREE.MeshBasicMaterial({color: 0x0b57a4, depthTest: false}));
      line.renderOrder = 9;
      const dot = new THREE.Mesh(new THREE.SphereBufferGeometry(0.003, 12, 8), new THREE.MeshBasicMaterial({color: 0x0b57a4, depthTest: false}));
      dot.renderOrder = 9;
      view.world.add(line, dot);
      pull.lines.push({line, dot});
    }
    pull.lines.forEach(({line, dot}, i) => {
      line.visible = dot.visible = i < springs.length;
      if (!line.visible) return;
      const [body, x, y, z, gx, gy, gz] = springs[i], at = view.bodies[body].localToWorld(new THREE.Vector3(x, y, z));
      dot.position.set(gx, gy, gz);
      const along = dot.position.clone().sub(at), length = along.length();
      line.position.copy(at);
      line.scale.set(1, Math.max(1e-6, length), 1);
      if (length > 1e-9) line.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.normalize());
    });
    pull.force = springs.reduce((sum, s) => sum + Math.hypot(s[7], s[8], s[9]), 0);
    view.changed();
  }

  function tellPicked() {
    const body = view.picked();
    if (body === null) { label.textContent = springs.length ? `pulled with ${pull.force.toFixed(2)} N` : ''; return; }
    const {name, mass} = data.scene.bodies[body], lines = [`${name}: ${mass === null ? 'fixed or driven' : mass < 0.1 ? Table.text(1e3 * mass) + ' g' : Table.text(mass) + ' kg'}`];
    if (springs.length) lines.push(`pulled with ${pull.force.toFixed(2)} N`);
    if (view.hasContacts) {
      const sums = new Map();
      for (const c of view.contactsOf(body)) {
        const other = (c.a.body === body ? c.b : c.a).name;
        sums.set(other, (sums.get(other) || 0) + Math.hypot(...c.force));
      }
      for (const [other, force] of [...sums].slice(0, 6)) lines.push(`  ${other}: ${force.toPrecision(3)} N`);
    }
    label.textContent = lines.join('\n');
  }

  // Curves that grow.
  let groups = [], partOf = [];
  const window_ = element('select', {'aria-label': 'time shown'}, [5, 10, 30, 60].map(s => element('option', {value: s, selected: s === 10}, `last ${s} s`)));
  const finger = element('select', {'aria-label': 'curves of this finger', change: () => groups.forEach(g => g.plot.only(passes))});
  const passes = name => !finger.value || name.includes(finger.value) || !/thumb|index|middle|ring|little|palm|wrist/.test(name);
  function makeCurves() {
    const shapes = data.scene.shapes, colours = Curves.palette;
    const parts = [...new Set(shapes.filter(s => s.hand).map(s => `${s.hand}.${s.part}`))];
    const bodyPart = new Map(shapes.filter(s => s.hand).map(s => [s.body, `${s.hand}.${s.part}`]));
    partOf = data.scene.bodies.map((_, i) => parts.indexOf(bodyPart.get(i)));
    const object = data.objects.map(name => data.scene.bodies.findIndex(body => body.name === name));
    const fingers = ['thumb', 'index', 'middle', 'ring', 'little', 'wrist'];
    const sums = new Float32Array(parts.length);
    const touching = () => {
      sums.fill(0);
      for (let i = 0; i < (contacts ? contacts.starts[1] : 0); ++i) {
        const force = Math.hypot(...contacts.values.subarray(6 * i + 3, 6 * i + 6));
        for (const side of [0, 1]) { const part = partOf[data.names[contacts.shapes[2 * i + side]].body]; if (part >= 0) sums[part] += force; }
      }
    };
    const colour = name => colours[Math.max(0, fingers.findIndex(f => name.includes(f))) % colours.length];
    groups = [
      {title: 'contact forces', unit: 'N', names: data.names.length ? parts : [], before: touching, value: i => sums[i]},
      {title: 'heights of objects', unit: 'mm', names: data.objects, value: i => 1e3 * poses[7 * object[i] + 2]},
      {title: 'angles', unit: 'deg', names: data.coordinates, value: i => 180 / Math.PI * angles[i]},
      {title: 'pull', unit: 'N', names: ['springs'], value: () => springs.reduce((sum, s) => sum + Math.hypot(s[7], s[8], s[9]), 0)},
    ].filter(group => group.names.length);
    const span = [0, 10];
    for (const group of groups) {
      group.times = new Float32Array(KEPT);
      group.values = group.names.map(() => new Float32Array(KEPT));
      group.list = group.names.map((name, i) => ({name, times: group.times.subarray(0, 0), values: group.values[i].subarray(0, 0),
        colour: group.unit === 'mm' ? colours[i % colours.length] : colour(name), dash: name.startsWith('left') ? [5, 3] : []}));
      group.plot = Curves.plot(group.title, group.unit, group.list, span, t => send('seek', {time: Math.max(0, t)}));
      group.count = 0;
      group.span = span;
    }
    finger.replaceChildren(element('option', {value: ''}, 'all fingers'), ...fingers.filter(f => data.coordinates.some(c => c.includes(f))).map(f => element('option', {}, f)));
    finger.value = data.coordinates.some(c => c.includes('index')) ? 'index' : '';
    curves.replaceChildren(element('div', {class: 'bar'}, window_, finger), ...groups.map(g => g.plot.element));
    groups.forEach(g => g.plot.only(passes));
  }

  function keepCurves() {
    for (const group of groups) {
      const last = group.count ? group.times[group.count - 1] : -1;
      if (time <= last) continue;
      if (group.count === KEPT) {
        group.times.copyWithin(0, KEPT / 8);
        for (const values of group.values) values.copyWithin(0, KEPT / 8);
        group.count -= KEPT / 8;
      }
      if (group.before) group.before();
      group.times[group.count] = time;
      // Rounding errors of what does not move are 0.
      group.values.forEach((values, i) => { const value = group.value(i); values[group.count] = Math.abs(value) < 1e-9 ? 0 : value; });
      ++group.count;
      group.stale = true;
    }
  }

  /** Going on from a past moment takes away what came after it. */
  function cutCurves(end) {
    for (const group of groups)
      while (group.count && group.times[group.count - 1] > end + 1e-6) { --group.count; group.stale = true; }
  }

  function drawCurves() {
    for (const group of groups) {
      if (!group.stale && group.cursor === time) continue;
      group.stale = false;
      group.cursor = time;
      const end = Math.max(time, +window_.value);
      group.span[0] = end - +window_.value;
      group.span[1] = end;
      group.list.forEach((curve, i) => { curve.times = group.times.subarray(0, group.count); curve.values = group.values[i].subarray(0, group.count); });
      group.plot.update();
      group.plot.cursor(time);
    }
  }
  setInterval(drawCurves, 150);

  // What the page tells.
  const words_ = {true: ['held', 'held'], false: ['FAILED', 'failed']};
  function tell() {
    if (!state.past) cutCurves(state.present);
    playButton.textContent = state.playing ? '❚❚ pause' : '▶ play';
    if (view) view.moving(state.playing);
    if (document.activeElement !== slider || state.playing) { slider.min = state.start; slider.max = Math.max(state.present, state.start + 1e-3); slider.value = state.time; }
    speedBox.value = state.speed;
    engine.value = state.engine;
    stepBox.value = String(1e3 * state.step);
    const factor = state.playing ? `${state.factor.toFixed(2)} × real time, ${(100 * state.load).toFixed(0)} % of a core` : 'paused';
    status.textContent = `${state.time.toFixed(3)} s; ${state.engine}, step ${Table.text(1e3 * state.step)} ms; ${factor}`
      + (state.lateness_p99_ms !== null && state.playing ? `; 99 % of steps within ${state.lateness_p99_ms.toFixed(2)} ms` : '');
    measured.replaceChildren(...Object.entries(state.tracked).map(([name, of]) => element('div', {}, of.trouble ? of.trouble
      : `${name} hand: length ${of.hand_length_mm} mm, breadth ${of.hand_breadth_mm} mm, measured in ${of.seconds} s; points ${of.points ? `as ${of.points} has them, by ${of.by}` : `: ${of.by}`}; noise ${of.noise_mm} mm${of.assumed.length ? `; not told by the motion so far, as usual: ${of.assumed.join(', ')}` : ''}`)));
    past.textContent = state.past ? `${(state.present - state.time).toFixed(2)} s before the present: play goes on from here` : '';
    past.hidden = !state.past;
    verdicts.replaceChildren(...(state.verdicts || []).map(v => {
      const known = v.measured !== null, [text, style] = !known ? ['not measured', 'open'] : v.limit === null ? ['', 'none'] : words_[v.held];
      return element('tr', {}, element('th', {scope: 'row'}, v.name.replace(/_/g, ' ')), element('td', {class: style}, text),
        element('td', {class: 'number'}, known ? `${Table.text(Math.abs(v.measured) < 1e-12 ? 0 : +v.measured.toPrecision(3))} ${v.unit}` : '–'),
        element('td', {class: 'number'}, v.limit === null ? '' : `${v.least ? '≥' : '≤'} ${Table.text(+v.limit.toPrecision(3))}`));
    }));
    for (const control of controls) control.show();
    tellNotices();
  }
  let said = 0;
  function tellNotices() {
    const list = [...(state.failed ? [state.broken ? `Paused: ${state.failed}` : `Diverged: ${state.failed}`] : []), ...(state.said > said && state.notices[state.notices.length - 1] !== state.failed && state.notices.length ? [state.notices[state.notices.length - 1]] : []), ...(problem ? [problem] : []),
      ...(state.recording_full ? [`The recording has ended: ${state.recording_full}.`] : [])];
    notice.hidden = !list.length;
    notice.textContent = list.join('\n');
  }

  // What takes hold of it.
  let controls = [];
  function range(text, low, high, unit, read, write, scale = 1) {
    const value = element('output'), input = element('input', {type: 'range', min: low * scale, max: high * scale, step: (high - low) * scale / 400, 'aria-label': text,
      input: () => { write(+input.value / scale); value.textContent = `${(+input.value).toPrecision(3)} ${unit}`; }});
    controls.push({show() {
      if (document.activeElement === input && input.matches(':active')) return;
      const now = read();
      if (now === null || now === undefined) return;
      input.value = now * scale;
      value.textContent = `${Table.text(+(now * scale).toPrecision(3))} ${unit}`;
    }});
    return element('label', {class: 'row'}, element('span', {}, text), input, value);
  }
  function box(text, unit, read, write, step = 'any') {
    const input = element('input', {type: 'number', step, 'aria-label': text, change: () => write(+input.value)});
    controls.push({show() { const now = read(); if (document.activeElement !== input && now !== undefined && now !== null) input.value = +now.toPrecision(6); }});
    return element('label', {class: 'row'}, element('span', {}, text), input, element('output', {}, unit));
  }
  const part = (title, open, ...children) => element('details', {open}, element('summary', {}, title), ...children);
  const button = (text, click, more = {}) => element('button', {type: 'button', click, ...more}, text);

  /** Sliders of a vector, in groups by hand and finger. */
  function vector(names, low, high, unit, scale, current, write) {
    const groups_ = new Map();
    names.forEach((name, i) => {
      const [hand, joint] = name.split('.'), key = names.length > 30 || data.hands.length > 1 ? `${hand} ${joint.split('_')[0]}` : joint.split('_')[0];
      if (!groups_.has(key)) groups_.set(key, []);
      groups_.get(key).push(range(name.split('.').slice(1).join(' ').replace(/_/g, ' '), low(i), high(i), unit, () => current()[i], v => write(i, v), scale));
    });
    return [...groups_].map(([key, rows]) => element('details', {}, element('summary', {class: 'dim'}, key), ...rows));
  }

  function fill() {
    controls = [];
    const targets = () => state.targets || data.axis_coordinates.map(c => angles ? angles[c] : 0);
    const set = (what, get, i, value) => { const values = [...get()]; values[i] = value; state[what] = values; send(what, {values}); };
    const bound = (c, side, other) => data.limits[c][side] === null ? other : data.limits[c][side];
    const torques = () => state.torques || data.coordinates.map(() => 0), excitations = () => state.excitations || data.muscles.map(() => 0);
    const number = name => state.numbers[name] === undefined ? data.numbers[name] : state.numbers[name];
    const setNumber = (name, value) => send('number', {name, value});
    const gravity = () => { const g = number('gravity'); return g ? g[2] : undefined; };
    const order = name => ['right', 'left', 'thumb', 'index', 'middle', 'ring', 'little', 'wrist', 'extrinsic', 'intrinsic', 'median', 'ulnar', 'radial'].indexOf(name) + (data.hands.includes(name) ? 0 : 1);
    const persons = data.hands.length > 0;
    const override = key => { const found = Object.entries(state.overrides).find(([name]) => name.endsWith(`person.${key}`)); return found ? +found[1] : (data.persons[0] || {})[key]; };
    panel.replaceChildren(...[
      element('div', {class: 'row'}, element('span', {}, 'mouse on a body'), mode, element('output')),
      element('div', {class: 'row'}, element('span', {}, 'largest force'), strength, element('output', {}, `${strength.value} N`)),
      Object.keys(data.poses).length && data.axes.length ? part('Poses', true, element('div', {class: 'bar'}, Object.keys(data.poses).map(name => button(name.replace(/_/g, ' '), () => send('pose', {name}), {'data-pose': name})),
        button('the scene\'s program', () => send('targets', {release: true})))) : null,
      data.axes.length ? part('Targets of joints', false, ...vector(data.axes, i => bound(data.axis_coordinates[i], 0, -1.6), i => bound(data.axis_coordinates[i], 1, 1.6), '°', 180 / Math.PI, targets, (i, v) => set('targets', targets, i, v)),
        button('the scene\'s program', () => { state.targets = null; send('targets', {release: true}); })) : null,
      data.muscles.length ? part('Excitations of muscles, by group', true, ...Object.entries(data.muscle_groups).sort(([a], [b]) => order(a) - order(b)).map(([name, of]) =>
        range(name, 0, 1, '', () => of.reduce((sum, i) => sum + excitations()[i], 0) / of.length, v => { const values = [...excitations()]; for (const i of of) values[i] = v; state.excitations = values; send('excitations', {values}); })),
      button('the scene\'s excitations', () => { state.excitations = null; send('excitations', {release: true}); })) : null,
      data.coordinates.length ? part('Torques on joints', false, ...vector(data.coordinates, () => -1, () => 1, 'N m', 1, torques, (i, v) => set('torques', torques, i, v)),
        button('none', () => { state.torques = null; send('torques', {release: true}); })) : null,
      part('Scene', true, gravity() === undefined ? null : range('gravity, z', -20, 20, 'm/s²', gravity, v => setNumber('gravity', [0, 0, v])),
        ...data.all_objects.flatMap((name, i) => [['mass', 'kg'], ['friction', '']].filter(([key]) => data.numbers[`objects.${i}.${key}`] !== undefined)
          .map(([key, unit]) => box(`${name}: ${key}`, unit, () => number(`objects.${i}.${key}`), v => setNumber(`objects.${i}.${key}`, v)))),
        element('div', {class: 'row'}, element('span', {}, 'engine'), engine, element('output')),
        element('div', {class: 'row'}, element('span', {}, 'step'), stepBox, element('output', {}, 'ms'))),
      persons ? part('Person', true, box('stature', 'm', () => override('stature'), v => send('scene', {stature: v})), box('mass of the body', 'kg', () => override('mass'), v => send('scene', {mass: v}))) : null,
      part('Verdicts up to now', true, element('div', {class: 'scroll'}, element('table', {}, verdicts))),
      part('Save', true, element('div', {class: 'bar'}, ['recording', 'snapshot', 'scene'].map(what => button(what, () => save(what), {'data-save': what}))),
        element('p', {class: 'dim'}, 'A recording is repeated to the bit by handsim live --replay; a snapshot continues with handsim run --from-snapshot; a scene has hands and objects where they are.')),
    ].filter(Boolean));
    makeCurves();
    for (const control of controls) control.show();
  }

  async function save(what) {
    const answer = await fetch(`/save/${what}${location.search}`);
    if (!answer.ok) { problem = await answer.text(); tellNotices(); return; }
    const link = element('a', {href: URL.createObjectURL(await answer.blob()), download: /filename="(.*)"/.exec(answer.headers.get('Content-Disposition'))[1]});
    link.click();
    setTimeout(() => URL.revokeObjectURL(link.href), 1000);
  }

  // Elements.
  const label = element('div', {class: 'label', 'aria-live': 'off'}), legend3d = element('div', {class: 'legend3d'});
  const screen = element('div', {class: 'screen'}, label, legend3d), layers = element('div', {class: 'parts', id: 'layers'}), panel = element('div', {class: 'panel'});
  const status = element('span', {class: 'status', id: 'status'}), past = element('span', {class: 'past', hidden: true}), measured = element('p', {class: 'dim', id: 'measured'}), notice = element('p', {class: 'notice', hidden: true, click: () => { problem = ''; said = state.said; tellNotices(); }});
  const verdicts = element('tbody'), curves = element('section', {class: 'plots'});
  const playButton = element('button', {type: 'button', id: 'play', click: () => send('play', {on: !state.playing})}, '▶ play');
  const speeds = [0.1, 0.2, 0.5, 1, 2, 5, 10];
  const speedBox = element('select', {'aria-label': 'speed', change: () => send('speed', {value: +speedBox.value})}, speeds.map(s => element('option', {value: s}, s < 1 ? `1/${Math.round(1 / s)} speed` : `${s} × speed`)));
  const slider = element('input', {type: 'range', id: 'time', step: 'any', 'aria-label': 'time: the last minute', input: () => send('seek', {time: +slider.value})});
  const mode = element('select', {'aria-label': 'mouse on a body'}, [['pull', 'pulls it by a spring'], ['push', 'pushes it'], ['orbit', 'turns the camera']].map(([value, text]) => element('option', {value}, text)));
  const strength = element('input', {type: 'range', min: 1, max: 50, step: 1, value: 20, 'aria-label': 'largest force', input: () => { strength.nextSibling.textContent = `${strength.value} N`; }});
  const lookBox = element('select', {'aria-label': 'hands as skin, shapes or both (s)', hidden: true, change: () => setLook(lookBox.value)}, looks.map(look => element('option', {}, look)));
  const engine = element('select', {'aria-label': 'engine', change: () => send('scene', {engine: engine.value})}, ['articulated', 'ode', 'dae'].map(name => element('option', {}, name)));
  const stepBox = element('select', {'aria-label': 'step', change: () => send('scene', {step: 1e-3 * +stepBox.value})}, [0.1, 0.25, 0.5, 1, 2, 5].map(value => element('option', {value}, String(value))));
  const seek = t => send('seek', {time: Math.max(state.start, t)});
  const keys = {' ': () => send('play', {on: !state.playing}), ArrowRight: () => state.past ? seek(time + 1 / 60) : send('step', {steps: 1}), ArrowLeft: () => seek(time - 1 / 60),
    Home: () => seek(state.start), End: () => send('present'), r: resetCamera, s: () => view && view.hasSkin && setLook(looks[(looks.indexOf(view.look()) + 1) % 3]), '+': () => view && view.orbit.zoom(0.9), '-': () => view && view.orbit.zoom(1.1), Escape: () => pull.end()};
  const help = [['Space', 'play, pause'], ['→', 'one step (in the past: a frame)'], ['←', 'a frame back'], ['Home End', 'a minute back, the present'], ['c f a', 'contact points, forces, joint axes'], ['r', 'camera of the pictures'], ['+ −', 'zoom']];
  document.body.append(
    element('header', {}, element('h1', {}, data.title), element('p', {class: 'dim'}, status, ' ', past), measured, notice),
    element('main', {class: 'live'},
      element('div', {}, screen, element('div', {class: 'track'}, slider),
        element('div', {class: 'bar'}, playButton, button('|▸ step', () => send('step', {steps: 1}), {id: 'step'}), speedBox, button('present', () => send('present'), {id: 'present'}),
          button('reset', () => send('reset'), {id: 'reset'}), button('reset camera', resetCamera), lookBox), layers,
        part('Keys and mouse', false, element('table', {}, element('tbody', {}, help.map(([key, text]) => element('tr', {}, element('td', {}, element('kbd', {}, key)), element('td', {}, text))))),
          element('p', {class: 'dim'}, 'A drag on a body pulls it, or moves a driven wrist; beside bodies it turns the camera. Shift-drag, right button or two fingers: pan. Wheel: zoom.')),
        curves),
      panel));
  const listeners = {pointerdown: 'begin', pointermove: 'move', pointerup: 'end', pointercancel: 'end', lostpointercapture: 'end'};
  for (const [name, what] of Object.entries(listeners)) screen.addEventListener(name, event => pull[what](event), true);
  document.addEventListener('keydown', event => {
    const of = event.target, typing = /^(SELECT|TEXTAREA)$/.test(of.tagName) || of.tagName === 'INPUT' && of.type !== 'checkbox';
    const onButton = /^(BUTTON|SUMMARY|A)$/.test(of.tagName) || of.tagName === 'INPUT';
    if (event.ctrlKey || event.metaKey || event.altKey || typing || event.key === ' ' && onButton) return;
    const layer = toggles.find(([, , key]) => key === event.key);
    const action = layer && boxes[layer[0]] ? () => { const box = boxes[layer[0]]; box.checked = !box.checked; view.show(layer[0], box.checked); } : keys[event.key];
    if (!action) return;
    event.preventDefault();
    action();
  });
  fill();
  connect();
  requestAnimationFrame(tick);
  /** For tests and scripts in the browser's console. */
  window.handsimLive = {state, send, latency, bodyAt(clientX, clientY) { const found = pull.hit({clientX, clientY}); return found ? found.object.userData.shape.body : 0; }, get view() { return view; }, get time() { return time; }, get springs() { return springs; }, get views() { return [views, shownViews]; }, get angles() { return angles; }};
})();
