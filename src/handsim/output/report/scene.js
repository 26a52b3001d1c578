// The scene in 3D: bodies with their shapes, hands with their skin, a ghost, contacts, axes, trails, light, camera and picking.
'use strict';

const Scene = (() => {
  const V = (list) => new THREE.Vector3(list[0], list[1], list[2]);

  /** Poses of a run between its kept rows. */
  function motion(poses) {
    const times = floats(poses.times), values = floats(poses.values), width = 7 * poses.moving.length;
    const place = new Map(poses.moving.map((body, i) => [body, 7 * i]));
    const q0 = new THREE.Quaternion(), q1 = new THREE.Quaternion();
    return {
      times,
      end: times[times.length - 1],
      start: times[0],
      moves: body => place.has(body),
      /** Sets position and quaternion of a body at time t. */
      pose(body, t, position, quaternion) {
        if (!place.has(body)) {
          const x = poses.fixed[body];
          position.set(x[0], x[1], x[2]);
          quaternion.set(x[3], x[4], x[5], x[6]);
          return;
        }
        const row = Math.min(rowAt(times, t), Math.max(0, times.length - 2));
        const a = row * width + place.get(body), b = times.length > 1 ? a + width : a;
        const span = times.length > 1 ? times[row + 1] - times[row] : 1;
        const share = Math.min(1, Math.max(0, (t - times[row]) / span));
        const mix = i => values[a + i] + share * (values[b + i] - values[a + i]);
        position.set(mix(0), mix(1), mix(2));
        q0.set(values[a + 3], values[a + 4], values[a + 5], values[a + 6]);
        q1.set(values[b + 3], values[b + 4], values[b + 5], values[b + 6]);
        quaternion.copy(q0);
        if (share > 0) quaternion.slerp(q1, share);
      },
    };
  }

  /** Contact points of a run: rows with positions, forces and the two shapes of each. */
  function contactRows(contacts) {
    if (!contacts) return null;
    const times = floats(contacts.times), starts = floats(contacts.starts), values = floats(contacts.values), shapes = words(contacts.shapes);
    return {
      largest: contacts.largest,
      most: contacts.most || starts.reduce((most, start, i) => i ? Math.max(most, start - starts[i - 1]) : 0, 0),
      /** The contacts at a time: {position, force, a, b}. */
      at(t) {
        const row = rowAt(times, t + 1e-6), out = [];
        for (let i = starts[row]; i < starts[row + 1]; ++i)
          out.push({position: values.subarray(6 * i, 6 * i + 3), force: values.subarray(6 * i + 3, 6 * i + 6),
            a: contacts.names[shapes[2 * i]], b: contacts.names[shapes[2 * i + 1]]});
        return out;
      },
    };
  }

  /** Triangles of a shape: points of a unit core, stretched and rounded, or those of a polyhedron. */
  function geometries(meshes) {
    const units = {};
    for (const [name, mesh] of Object.entries(meshes)) units[name] = {vertices: floats(mesh.vertices), indices: words(mesh.indices)};
    return shape => {
      const out = new THREE.BufferGeometry();
      if (shape.core === 'hull') {
        out.setAttribute('position', new THREE.BufferAttribute(floats(shape.corners), 3));
        out.computeVertexNormals();
        return out;
      }
      const round = shape.half[0] <= 0 && shape.half[1] <= 0;
      const unit = units[shape.core === 'cylinder' ? 'cylinder' : round ? 'capsule' : 'box'], count = unit.vertices.length / 6;
      const positions = new Float32Array(3 * count), normals = new Float32Array(3 * count);
      for (let i = 0; i < count; ++i)
        for (let k = 0; k < 3; ++k) {
          const n = unit.vertices[6 * i + 3 + k];
          positions[3 * i + k] = unit.vertices[6 * i + k] * shape.half[k] + shape.round * n;
          normals[3 * i + k] = n;
        }
      out.setAttribute('position', new THREE.BufferAttribute(positions, 3));
      out.setAttribute('normal', new THREE.BufferAttribute(normals, 3));
      out.setIndex(new THREE.BufferAttribute(unit.indices, 1));
      return out;
    };
  }

  const colourOf = list => new THREE.Color(list[0], list[1], list[2]);

  /** True if the processor draws: then no smoothed edges, simpler shadows and no highlights, for a fluent motion. */
  function drawsInSoftware() {
    const gl = document.createElement('canvas').getContext('webgl');
    if (!gl) return false;
    const info = gl.getExtension('WEBGL_debug_renderer_info'), name = info ? gl.getParameter(info.UNMASKED_RENDERER_WEBGL) : '';
    const lose = gl.getExtension('WEBGL_lose_context');
    if (lose) lose.loseContext();
    return /swiftshader|llvmpipe|software/i.test(name);
  }

  /** The groups of a run's bodies with their shapes. */
  function bodies(run, geometry, ghost, plain) {
    const groups = run.scene.bodies.map(() => new THREE.Group());
    for (const shape of run.scene.shapes) {
      const colour = colourOf(shape.colour);
      if (ghost) colour.lerp(new THREE.Color(0.10, 0.16, 0.45), 0.65);
      const look = {color: colour, transparent: ghost, opacity: ghost ? 0.4 : 1, depthWrite: !ghost};
      const material = plain ? new THREE.MeshLambertMaterial(look) : new THREE.MeshPhongMaterial({...look, specular: 0x222222, shininess: 36});
      const mesh = new THREE.Mesh(geometry(shape), material);
      mesh.position.set(...shape.pose.slice(0, 3));
      mesh.quaternion.set(...shape.pose.slice(3));
      mesh.castShadow = mesh.receiveShadow = !ghost;
      mesh.userData = {shape, ghost};
      mesh.renderOrder = ghost ? 1 : 0;
      groups[shape.body].add(mesh);
    }
    return groups;
  }

  const up = new THREE.Vector3(0, 0, 1);

  /** A shaft with a head from one point to another, as in the pictures. */
  function arrow(from, to, radius, colour) {
    const out = new THREE.Group(), along = to.clone().sub(from), length = along.length();
    const head = Math.min(2.6 * 2.4 * radius, 0.6 * length);
    radius = head / 2.6 / 2.4;
    const material = new THREE.MeshLambertMaterial({color: colour});
    const shaft = new THREE.Mesh(new THREE.CylinderBufferGeometry(radius, radius, length - head, 12), material);
    const tip = new THREE.Mesh(new THREE.ConeBufferGeometry(2.4 * radius, head, 16), material);
    shaft.position.y = (length - head) / 2;
    tip.position.y = length - head / 2;
    out.add(shaft, tip);
    out.position.copy(from);
    out.quaternion.setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.normalize());
    return out;
  }

  /** Points and force arrows of contacts, as instances of three meshes. */
  function contactMeshes(rows) {
    const count = Math.max(1, rows ? rows.most : 0);
    const make = (geometry, colour, order) => {
      const material = new THREE.MeshLambertMaterial({color: colour, depthTest: order === 0, transparent: order > 0});
      const mesh = new THREE.InstancedMesh(geometry, material, count);
      mesh.frustumCulled = false;
      mesh.renderOrder = order;
      mesh.count = 0;
      return mesh;
    };
    const force = new THREE.Color(0.75, 0, 0.35);
    const shaft = new THREE.CylinderBufferGeometry(1, 1, 1, 10), head = new THREE.ConeBufferGeometry(1, 1, 14);
    shaft.translate(0, 0.5, 0);
    head.translate(0, 0.5, 0);
    const points = make(new THREE.SphereBufferGeometry(0.0025, 12, 8), new THREE.Color(0.9, 0.05, 0.05), 0);
    const shafts = make(shaft, force, 5), heads = make(head, force, 5);
    // A round number of metres per newton for which the largest force has 40 to 100 mm.
    let scale = 0;
    if (rows && rows.largest > 0) {
      const most = 0.1 / rows.largest, decade = 10 ** Math.floor(Math.log10(most)), share = most / decade;
      scale = decade * (share >= 5 ? 5 : share >= 2 ? 2 : 1);
    }
    const matrix = new THREE.Matrix4(), q = new THREE.Quaternion(), y = new THREE.Vector3(0, 1, 0);
    const size = new THREE.Vector3(), at = new THREE.Vector3(), along = new THREE.Vector3();
    return {
      meshes: {points: [points], forces: [shafts, heads]},
      scale,
      update(all) {
        const list = all.slice(0, count);
        let forces = 0;
        list.forEach((contact, i) => {
          at.fromArray(contact.position);
          points.setMatrixAt(i, matrix.makeTranslation(at.x, at.y, at.z));
          along.fromArray(contact.force).multiplyScalar(scale);
          const length = along.length();
          if (!(length > 1e-5)) return;
          const tip = Math.min(2.6 * 2.4 * 0.0012, 0.6 * length), wide = tip / 2.6, thin = wide / 2.4;
          q.setFromUnitVectors(y, along.normalize());
          shafts.setMatrixAt(forces, matrix.compose(at, q, size.set(thin, length - tip, thin)));
          at.addScaledVector(along, length - tip);
          heads.setMatrixAt(forces++, matrix.compose(at, q, size.set(wide, tip, wide)));
        });
        points.count = list.length;
        shafts.count = heads.count = forces;
        for (const mesh of [points, shafts, heads]) mesh.instanceMatrix.needsUpdate = true;
      },
    };
  }

  /** The paths of fingertips up to now. */
  function trails(run, move, colours) {
    const p = new THREE.Vector3(), q = new THREE.Quaternion();
    const lines = run.scene.tips.map(tip => {
      const positions = new Float32Array(3 * move.times.length);
      move.times.forEach((t, i) => {
        move.pose(tip.body, t, p, q);
        V(tip.point).applyQuaternion(q).add(p).toArray(positions, 3 * i);
      });
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute('position', new THREE.BufferAttribute(positions, 3));
      const line = new THREE.Line(geometry, new THREE.LineBasicMaterial({color: colours[tip.part] || 0x333333}));
      line.frustumCulled = false;
      line.userData = {shape: tip};
      return line;
    });
    return {lines, update: t => lines.forEach(line => line.geometry.setDrawRange(0, rowAt(move.times, t) + 1))};
  }

  // The floor of the pictures: lines by the share of a pixel that they cover, which do not flicker.
  const floorVertex = 'varying vec2 at; void main() { at = (modelMatrix * vec4(position, 1.0)).xy; gl_Position = projectionMatrix * viewMatrix * vec4(at, modelMatrix[3].z, 1.0); }';
  const floorFragment = `
    uniform vec2 centre; uniform float fade, spacing; varying vec2 at;
    float lines(vec2 p, vec2 footprint, float width) {
      vec2 f = max(footprint, vec2(1e-5)), q = p + 0.5 * width, a = q + 0.5 * f, b = q - 0.5 * f;
      vec2 i = (floor(a) * width + min(fract(a), vec2(width)) - floor(b) * width - min(fract(b), vec2(width))) / f;
      return 1.0 - (1.0 - i.x) * (1.0 - i.y);
    }
    void main() {
      vec2 footprint = 1.2 * fwidth(at) / spacing;
      float far = length(at - centre) / fade;
      float coarse = lines(at / spacing, footprint, 0.0136), fine = 0.0;
    #ifndef PLAIN
      fine = lines(5.0 * at / spacing, 5.0 * footprint, 0.04);
    #endif
      float albedo = 1.0 - max(0.10 * fine, 0.22 * coarse) * (1.0 - smoothstep(0.2, 0.8, far));
      gl_FragColor = vec4(vec3(0.915, 0.915, 0.91) * albedo, 1.0 - smoothstep(0.25, 1.0, far));
    }`;

  /**
   * A floor with lines that fades, and a plane that only has shadows.
   * @param box of all that casts shadows. @param sun direction towards the light. @param plain with the coarse lines alone
   */
  function floor(height, centre, radius, box, sun, plain) {
    const fade = 7 * radius, low = new THREE.Vector2(Infinity, Infinity), high = low.clone().negate();
    for (const z of [Math.max(height, box.min.z), Math.max(height, box.max.z)])
      for (const corner of [box.min, box.max]) {
        const at = new THREE.Vector2(corner.x, corner.y).addScaledVector(new THREE.Vector2(sun.x, sun.y), (height - z) / sun.z);
        low.min(at);
        high.max(at);
      }
    const plane = new THREE.Mesh(new THREE.PlaneBufferGeometry(2 * fade, 2 * fade), new THREE.ShaderMaterial({
      uniforms: {centre: {value: new THREE.Vector2(centre.x, centre.y)}, fade: {value: fade}, spacing: {value: 10 ** Math.floor(Math.log10(3 * radius))}},
      vertexShader: floorVertex, fragmentShader: plain ? '#define PLAIN\n' + floorFragment : floorFragment, transparent: true, depthWrite: false, extensions: {derivatives: true}}));
    plane.position.set(centre.x, centre.y, height);
    plane.renderOrder = -2;
    const shadow = new THREE.Mesh(new THREE.PlaneBufferGeometry(high.x - low.x, high.y - low.y),
      new THREE.ShadowMaterial({opacity: 0.4, depthWrite: false, color: 0x14181c}));
    shadow.position.set((low.x + high.x) / 2, (low.y + high.y) / 2, height + 1e-4);
    shadow.receiveShadow = true;
    shadow.renderOrder = -1;
    return [plane, shadow];
  }

  /** The lights of the pictures, from the camera of the start. */
  function lights(camera, centre, radius, overGround, plain) {
    const x = new THREE.Vector3(), y = new THREE.Vector3(), z = new THREE.Vector3();
    camera.updateMatrixWorld();
    camera.matrixWorld.extractBasis(x, y, z);
    const to = (a, b, c) => new THREE.Vector3().addScaledVector(x, a).addScaledVector(y, b).addScaledVector(z, c).normalize();
    const key = to(-0.62, 0.72, 0.62);
    if (overGround && key.z < 0.62) {
      const level = Math.hypot(key.x, key.y) || 1, size = Math.sqrt(1 - 0.62 * 0.62);
      key.set(size * key.x / level, size * key.y / level, 0.62);
    }
    const sun = new THREE.DirectionalLight(new THREE.Color(1, 0.96, 0.9), 0.8);
    sun.position.copy(centre).addScaledVector(key, 4 * radius);
    sun.target.position.copy(centre);
    sun.castShadow = true;
    sun.shadow.mapSize.setScalar(2048);
    Object.assign(sun.shadow.camera, {left: -1.3 * radius, right: 1.3 * radius, top: 1.3 * radius, bottom: -1.3 * radius, near: radius, far: 8 * radius});
    sun.shadow.bias = -0.0008;
    sun.shadow.radius = 2.5;
    const sky = new THREE.HemisphereLight(new THREE.Color(0.92, 0.96, 1), new THREE.Color(1, 0.97, 0.94), 0.4);
    sky.groundColor.multiplyScalar(0.17 / 0.4);
    sky.position.copy(overGround ? up : to(0, 0.8, 0.6));
    const fill = new THREE.DirectionalLight(new THREE.Color(1, 1, 1), 0.18);
    fill.position.copy(to(0.55, 0.1, 0.83));
    return [sun, sun.target, sky, fill];
  }

  /** Orbit, pan and zoom about a target by mouse, fingers and keys. */
  function orbit(camera, canvas, pole, changed, clicked) {
    const target = new THREE.Vector3(), pointers = new Map(), lift = new THREE.Quaternion().setFromUnitVectors(pole, new THREE.Vector3(0, 1, 0));
    const drop = lift.clone().inverse(), ball = new THREE.Spherical(), arm = new THREE.Vector3();
    let moved = 0, gap = 0;
    function place() { camera.up.copy(pole); camera.lookAt(target); changed(); }
    function turn(right, down) {
      arm.copy(camera.position).sub(target).applyQuaternion(lift);
      ball.setFromVector3(arm);
      ball.theta -= right;
      ball.phi = Math.min(Math.PI - 0.02, Math.max(0.02, ball.phi - down));
      camera.position.copy(target).add(arm.setFromSpherical(ball).applyQuaternion(drop));
      place();
    }
    function zoom(factor) { camera.position.sub(target).multiplyScalar(factor).add(target); place(); }
    function pan(right, down) {
      const scale = 2 * camera.position.distanceTo(target) * Math.tan(camera.fov * Math.PI / 360) / canvas.clientHeight;
      const x = new THREE.Vector3(), y = new THREE.Vector3(), z = new THREE.Vector3();
      camera.matrixWorld.extractBasis(x, y, z);
      shift(x.multiplyScalar(-right * scale).addScaledVector(y, down * scale));
    }
    function shift(by) { camera.position.add(by); target.add(by); place(); }
    const spread = () => { const [a, b] = [...pointers.values()]; return Math.hypot(a.x - b.x, a.y - b.y); };
    canvas.addEventListener('pointerdown', event => {
      canvas.setPointerCapture(event.pointerId);
      pointers.set(event.pointerId, {x: event.clientX, y: event.clientY});
      if (pointers.size === 1) moved = 0;
      if (pointers.size === 2) gap = spread();
    });
    canvas.addEventListener('pointermove', event => {
      const last = pointers.get(event.pointerId);
      if (!last) return;
      const dx = event.clientX - last.x, dy = event.clientY - last.y;
      moved += Math.abs(dx) + Math.abs(dy);
      last.x = event.clientX;
      last.y = event.clientY;
      if (pointers.size === 2) {
        const now = spread();
        if (now > 0 && gap > 0) zoom(gap / now);
        gap = now;
        pan(dx / 2, dy / 2);
      } else if (event.shiftKey || (event.buttons & 6)) pan(dx, dy);
      else turn(dx * 0.008, dy * 0.008);
    });
    for (const end of ['pointerup', 'pointercancel'])
      canvas.addEventListener(end, event => {
        if (pointers.delete(event.pointerId) && pointers.size === 0 && moved < 5 && end === 'pointerup') clicked(event);
      });
    canvas.addEventListener('wheel', event => { event.preventDefault(); zoom(Math.exp(Math.sign(event.deltaY) * 0.12)); }, {passive: false});
    canvas.addEventListener('contextmenu', event => event.preventDefault());
    return {target, turn, zoom, shift, place};
  }

  /** Smallest boxes over the run: of the hands, or of all without hands, for floor and light; of all near them, for shadows. */
  function extent(run, move, camera) {
    const p = new THREE.Vector3(), q = new THREE.Quaternion(), m = new THREE.Vector3();
    function include(box, shapes, near) {
      for (const shape of shapes)
        for (let i = 0; i < 9; ++i) {
          move.pose(shape.body, move.start + i / 8 * (move.end - move.start), p, q);
          m.set(...shape.pose.slice(0, 3)).applyQuaternion(q).add(p);
          const reach = Math.hypot(...shape.half) + shape.round;
          if (near(m, reach)) box.expandByPoint(m.clone().addScalar(reach)).expandByPoint(m.clone().addScalar(-reach));
        }
      return box;
    }
    const held = run.scene.shapes.filter(shape => shape.hand);
    const box = include(new THREE.Box3(), held.length ? held : run.scene.shapes, () => true);
    if (box.isEmpty()) box.expandByPoint(V(camera.target));
    const centre = box.getCenter(new THREE.Vector3()), radius = Math.max(0.02, 0.62 * box.getSize(new THREE.Vector3()).length());
    const shading = include(box.clone(), run.scene.shapes, (at, reach) => at.distanceTo(centre) + reach < 2.2 * radius);
    return {centre, radius, shading};
  }

  /**
   * A view of one run, or of two with the second as a ghost.
   * @param screen element that holds the canvas. @param onPick(body or null)
   * @throws Error without WebGL.
   */
  function create(screen, runs, onPick) {
    const plain = drawsInSoftware() && !location.hash.includes('fine');
    const renderer = new THREE.WebGLRenderer({antialias: !plain, alpha: true, preserveDrawingBuffer: true});
    renderer.gammaOutput = true;
    renderer.gammaFactor = 2.2;
    renderer.shadowMap.enabled = true;
    renderer.shadowMap.type = plain ? THREE.BasicShadowMap : THREE.PCFShadowMap;
    const sharp = Math.min(2, window.devicePixelRatio || 1);
    renderer.setPixelRatio(sharp);
    const canvas = renderer.domElement;
    canvas.setAttribute('role', 'img');
    canvas.setAttribute('tabindex', '0');
    canvas.setAttribute('aria-label', 'The scene in 3D. Drag to orbit, shift-drag to pan, wheel to zoom, click a body for its figures.');
    screen.append(canvas);

    const main = runs[0], view = main.scene.camera, world = new THREE.Scene(), camera = new THREE.PerspectiveCamera(30, 1, 0.005, 100);
    const motions = runs.map(run => motion(run.poses)), contacts = contactRows(main.contacts), marks = contactMeshes(contacts);
    const solids = runs.map((run, i) => bodies(run, geometries(run.scene.meshes), i > 0, plain));
    const flatBodies = solids[0];
    for (const groups of solids) world.add(...groups);
    const partColours = {}, fingerColours = {};
    for (const shape of main.scene.shapes)
      if (!shape.mark) {
        partColours[shape.part] = colourOf(shape.colour);
        if (shape.part !== 'palm') fingerColours[shape.body] = partColours[shape.part];
      }
    // Two runs of one person share a skin in the page.
    const skins = runs.map((run, r) => (run.scene.skins || main.scene.skins).map((data, _, all) => Skin.create(data, all, solids[r], fingerColours, r > 0, plain)));
    for (const skin of skins.flat()) world.add(...skin.meshes);
    const paths = trails(main, motions[0], partColours);
    const axes = main.scene.axes.map(axis => {
      const out = arrow(V(axis.from), V(axis.to), axis.radius, colourOf(axis.colour));
      flatBodies[axis.body].add(out);
      return out;
    });
    const layers = {points: marks.meshes.points, forces: marks.meshes.forces, trails: paths.lines, axes, ghost: solids.slice(1).flat(), floor: []};
    world.add(...layers.points, ...layers.forces, ...layers.trails);
    const shown = {points: !!contacts, forces: !!contacts, trails: false, axes: false, ghost: true, floor: true, colours: main.scene.finger_colours};
    let look = skins[0].length ? main.scene.look : 'shapes';
    const hiddenParts = new Set(), hiddenHands = new Set();

    const {centre, radius, shading} = extent(main, motions[0], view);
    let time = motions[0].start, dirty = true, picked = null, follow = false;
    const changed = () => { dirty = true; };
    const direction = V(view.up);
    const controls = orbit(camera, canvas, Math.abs(direction.z) > 0.3 ? up.clone().multiplyScalar(Math.sign(direction.z)) : direction, changed, pick);
    // The camera follows the hand as in a video: [target, distance] over time, on top of what the reader does to it.
    const path = view.path && {times: floats(view.path.times), values: floats(view.path.values)};
    const goal = new THREE.Vector3(), held = new THREE.Vector3();
    let followHand = !!path, heldDistance = 1;
    function followed(t) {
      const row = Math.min(rowAt(path.times, t), Math.max(0, path.times.length - 2)), next = Math.min(row + 1, path.times.length - 1);
      const share = next > row ? Math.min(1, Math.max(0, (t - path.times[row]) / (path.times[next] - path.times[row]))) : 0;
      const mix = i => path.values[4 * row + i] + share * (path.values[4 * next + i] - path.values[4 * row + i]);
      goal.set(mix(0), mix(1), mix(2));
      return mix(3);
    }
    function hold() { heldDistance = followed(time); held.copy(goal); }
    function reset() {
      camera.position.copy(V(view.position));
      controls.target.copy(V(view.target));
      if (followHand) {
        hold();
        camera.position.sub(controls.target).setLength(heldDistance).add(held);
        controls.target.copy(held);
      }
      controls.place();
    }
    reset();
    const lit = lights(camera, centre, radius, main.scene.ground !== null, plain);
    world.add(...lit);
    if (main.scene.ground !== null) {
      layers.floor = floor(main.scene.ground, centre, radius, shading, lit[0].position.clone().sub(centre).normalize(), plain);
      world.add(...layers.floor);
    }

    function resize() {
      const width = Math.max(1, screen.clientWidth), height = Math.max(1, screen.clientHeight);
      renderer.setSize(width, height, false);
      camera.aspect = width / height;
      // A narrow view shows as much from left to right as the picture does.
      const wider = Math.max(1, view.aspect / camera.aspect);
      camera.fov = 360 / Math.PI * Math.atan(Math.tan(view.field_of_view / 2) * wider);
      camera.near = radius / 50;
      camera.far = 60 * radius + camera.position.distanceTo(centre);
      camera.updateProjectionMatrix();
      changed();
    }
    new ResizeObserver(resize).observe(screen);

    const before = new THREE.Vector3();
    function keep() { if (follow && picked !== null) before.copy(flatBodies[picked].position); }
    function place() {
      keep();
      solids.forEach((groups, r) => {
        const t = Math.min(Math.max(time, motions[r].start), motions[r].end);
        groups.forEach((group, body) => motions[r].pose(body, t, group.position, group.quaternion));
      });
      settle(contacts && contacts.at(time));
    }
    /** After the bodies have moved: skin, camera and contacts follow. */
    function settle(touching) {
      for (const skin of skins.flat()) skin.update();
      if (follow && picked !== null) controls.shift(flatBodies[picked].position.clone().sub(before));
      else if (followHand && path) {
        const distance = followed(time);
        controls.shift(goal.clone().sub(held));
        controls.zoom(distance / heldDistance);
        held.copy(goal);
        heldDistance = distance;
      }
      if (touching) marks.update(touching);
      if (shown.trails) paths.update(time);
      changed();
    }

    function visible(shape) { return !hiddenParts.has(shape.part) && !hiddenHands.has(shape.hand || ''); }
    function applyVisibility() {
      for (const [name, list] of Object.entries(layers)) for (const object of list) object.visible = shown[name];
      for (const groups of solids)
        for (const group of groups)
          for (const mesh of group.children) if (mesh.userData.shape) mesh.visible = visible(mesh.userData.shape);
      skins.forEach((list, r) => { for (const skin of list) putOn(skin, solids[r], r > 0); });
      paintSkins();
      for (const mesh of layers.points) {
        Object.assign(mesh.material, {depthTest: look === 'shapes', transparent: look !== 'shapes'});
        mesh.renderOrder = look === 'shapes' ? 0 : 4;
      }
      for (const line of paths.lines) line.visible = shown.trails && visible(line.userData.shape);
      for (const groups of solids.slice(1)) for (const group of groups) group.visible = shown.ghost;
      place();
    }

    /** A hand in its skin, its shapes, or both. What the skin covers is in a layer that only clicks see. */
    function putOn(skin, groups, ghost) {
      skin.show(look !== 'shapes' && !hiddenHands.has(skin.hand) && (!ghost || shown.ghost), look === 'both');
      for (const group of groups)
        for (const mesh of group.children) {
          const {shape} = mesh.userData;
          if (!shape || shape.hand !== skin.hand) continue;
          const nail = shape.mark && shape.part !== 'palm';
          mesh.layers.set(look === 'skin' && skin.covers(shape.body) && !nail ? 1 : 0);
          // A forearm has no skin of its own.
          if (shape.part === 'palm' && !skin.covers(shape.body) && !ghost) mesh.material.color.copy(look === 'shapes' ? colourOf(shape.colour) : skin.tone);
        }
    }
    function paintSkins() {
      const parts = {};
      for (const shape of main.scene.shapes) parts[shape.body] = shape.part;
      skins.forEach((list, r) => { for (const skin of list) skin.paint(shown.colours && look === 'skin', r ? null : picked, body => hiddenParts.has(parts[body])); });
    }

    function select(body) {
      picked = body;
      paintSkins();
      for (const group of flatBodies)
        for (const mesh of group.children)
          if (mesh.userData.shape) mesh.material.emissive.setRGB(...(mesh.userData.shape.body === body ? [0.16, 0.13, 0] : [0, 0, 0]));
      changed();
    }
    const ray = new THREE.Raycaster(), at = new THREE.Vector2();
    function pick(event) {
      const box = canvas.getBoundingClientRect();
      at.set(2 * (event.clientX - box.left) / box.width - 1, 1 - 2 * (event.clientY - box.top) / box.height);
      ray.setFromCamera(at, camera);
      const hit = ray.intersectObjects(flatBodies.flatMap(group => group.children.filter(m => m.visible && m.userData.shape)))[0];
      select(hit ? hit.object.userData.shape.body : null);
      onPick(picked);
    }

    /** Where the processor draws, a picture that moves has fewer pixels and coarser shadows than one that stands. */
    function moving(on) {
      const coarse = on && plain, ratio = sharp * (coarse ? 0.7 : 1), {shadow} = lit[0];
      if (ratio === renderer.getPixelRatio()) return;
      renderer.setPixelRatio(ratio);
      shadow.mapSize.setScalar(coarse ? 512 : 2048);
      if (shadow.map) shadow.map.dispose();
      shadow.map = null;
      changed();
    }

    function render() {
      if (!dirty) return false;
      dirty = false;
      renderer.render(world, camera);
      return true;
    }
    resize();
    applyVisibility();

    const p = new THREE.Vector3(), q = new THREE.Quaternion();
    return {
      start: motions[0].start,
      end: Math.max(...motions.map(m => m.end)),
      seek(t) { time = t; place(); },
      /** Poses that somebody else has, as of a running simulation: x y z and quaternion x y z w of each body, one after the other; and contacts as of contactRows().at. */
      setState(poses, touching) {
        keep();
        flatBodies.forEach((group, body) => {
          group.position.fromArray(poses, 7 * body);
          group.quaternion.fromArray(poses, 7 * body + 3);
        });
        settle(touching);
      },
      hasSkin: skins[0].length > 0,
      look: () => look,
      /** @param wanted skin, shapes or both */
      setLook(wanted) { look = wanted; applyVisibility(); },
      render, moving, reset, select, pick: onPick,
      orbit: controls,
      // For a page that adds to the view: what it draws, and what says that it has changed.
      world, camera, canvas, bodies: flatBodies, changed,
      picked: () => picked,
      show(layer, on) { shown[layer] = on; applyVisibility(); },
      isShown: layer => shown[layer],
      hidePart(part, hidden) { hiddenParts[hidden ? 'add' : 'delete'](part); applyVisibility(); },
      hideHand(hand, hidden) { hiddenHands[hidden ? 'add' : 'delete'](hand); applyVisibility(); },
      followsHand: followHand,
      followHand(on) { followHand = on; if (on) hold(); },
      /** Place of a body on the screen, -1 to 1 to the right and up. */
      onScreen(body) { camera.updateMatrixWorld(); const at = flatBodies[body].position.clone().project(camera); return [at.x, at.y]; },
      follow(on) { follow = on; if (!on && path) hold(); if (on && picked !== null) controls.shift(flatBodies[picked].position.clone().sub(controls.target)); },
      /** Distance of the skin to a point of a body [m]. */
      skinGap(body, point) { const at = V(point).applyQuaternion(flatBodies[body].quaternion).add(flatBodies[body].position); return Math.min(...skins[0].map(skin => skin.gap(at))); },
      forceScale: contacts && contacts.largest > 0 ? marks.scale : null,
      hasContacts: !!contacts,
      /** Speed of a body's centre of mass over the nearest kept rows [m/s]. */
      speed(body) {
        const times = motions[0].times, row = Math.min(rowAt(times, time), Math.max(0, times.length - 2));
        if (times.length < 2) return 0;
        motions[0].pose(body, times[row], p, q);
        const from = p.clone();
        motions[0].pose(body, times[row + 1], p, q);
        return p.distanceTo(from) / (times[row + 1] - times[row]);
      },
      contactsOf: body => contacts ? contacts.at(time).filter(c => c.a.body === body || c.b.body === body) : [],
      /** Draws frames one after the other as while playing; milliseconds for each. */
      measure(frames) {
        moving(true);
        const pixel = new Uint8Array(4), gl = renderer.getContext(), begin = performance.now();
        for (let i = 0; i < frames; ++i) {
          time = motions[0].start + (i / frames) * (motions[0].end - motions[0].start);
          place();
          renderer.render(world, camera);
          gl.readPixels(0, 0, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, pixel);
        }
        const took = (performance.now() - begin) / frames;
        moving(false);
        return took;
      },
    };
  }

  return {create};
})();
