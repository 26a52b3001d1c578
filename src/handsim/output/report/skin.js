// The skin of hands in a 3D view: a mesh that dual quaternions of its bodies bend, as in the pictures (Kavan et al. 2008,
// ACM TOG 27:105). The processor bends it, 2 ms a hand: where the processor also draws, that is faster than a vertex shader.
'use strict';

const Skin = (() => {
  /** Points of the rest posture, and the four strongest bodies of each with their shares. @param all skins of the run */
  function read(data, all) {
    if (data.mirror_of !== undefined) return mirrored(read(all[data.mirror_of], all));
    const numbers = words(data.points), influences = words(data.influences), count = numbers.length / 3;
    const points = new Float32Array(3 * count), bodies = new Uint8Array(4 * count), shares = new Float32Array(4 * count);
    for (let i = 0; i < 3 * count; ++i) points[i] = data.low[i % 3] + data.step[i % 3] * numbers[i];
    for (let i = 0; i < count; ++i) {
      let sum = 0;
      for (let k = 4 * i; k < 4 * i + 4; ++k) {
        bodies[k] = influences[k] >> 10;
        sum += shares[k] = influences[k] & 1023;
      }
      for (let k = 4 * i; k < 4 * i + 4; ++k) shares[k] /= sum;
    }
    return {count, points, bodies, shares, faces: words(data.faces)};
  }

  /** The other hand has the mirror image in the y-z plane. */
  function mirrored(rest) {
    const points = rest.points.map((x, i) => i % 3 ? x : -x), faces = rest.faces.map((_, i) => rest.faces[i % 3 ? i + 3 - 2 * (i % 3) : i]);
    return {...rest, points, faces};
  }

  /** Moves points and normals. @param motion of each body from the rest pose: q and t q / 2, eight numbers. @param swell outward [m] */
  function bend(rest, normals, motion, swell, toPoints, toNormals) {
    const {count, points, bodies, shares} = rest, sum = new Float64Array(8);
    for (let i = 0; i < count; ++i) {
      sum.fill(0);
      for (let k = 4 * i; k < 4 * i + 4 && shares[k] > 0; ++k) {
        const b = 8 * bodies[k];
        // q and -q are one rotation.
        const dot = sum[0] * motion[b] + sum[1] * motion[b + 1] + sum[2] * motion[b + 2] + sum[3] * motion[b + 3], share = dot < 0 ? -shares[k] : shares[k];
        for (let j = 0; j < 8; ++j) sum[j] += share * motion[b + j];
      }
      const size = 1 / Math.hypot(sum[0], sum[1], sum[2], sum[3]);
      const x = sum[0] * size, y = sum[1] * size, z = sum[2] * size, w = sum[3] * size, dx = sum[4] * size, dy = sum[5] * size, dz = sum[6] * size, dw = sum[7] * size;
      const xx = 1 - 2 * (y * y + z * z), xy = 2 * (x * y - w * z), xz = 2 * (x * z + w * y);
      const yx = 2 * (x * y + w * z), yy = 1 - 2 * (x * x + z * z), yz = 2 * (y * z - w * x);
      const zx = 2 * (x * z - w * y), zy = 2 * (y * z + w * x), zz = 1 - 2 * (x * x + y * y);
      const c = 3 * i, nx = normals[c], ny = normals[c + 1], nz = normals[c + 2];
      toNormals[c] = xx * nx + xy * ny + xz * nz;
      toNormals[c + 1] = yx * nx + yy * ny + yz * nz;
      toNormals[c + 2] = zx * nx + zy * ny + zz * nz;
      const px = points[c] + swell * nx, py = points[c + 1] + swell * ny, pz = points[c + 2] + swell * nz;
      toPoints[c] = xx * px + xy * py + xz * pz + 2 * (w * dx - dw * x + y * dz - z * dy);
      toPoints[c + 1] = yx * px + yy * py + yz * pz + 2 * (w * dy - dw * y + z * dx - x * dz);
      toPoints[c + 2] = zx * px + zy * py + zz * pz + 2 * (w * dz - dw * z + x * dy - y * dx);
    }
  }

  /**
   * The skin of a hand.
   * @param data of the page: points, faces, influences or a hand that it mirrors, bodies, rest poses, tone. @param all skins of the run. @param groups of the bodies, which have their poses
   * @param colours of the bodies, where fingers have some. @param ghost of another run: transparent. @param plain for a processor that draws
   */
  function create(data, all, groups, colours, ghost, plain) {
    const rest = read(data, all), tone = new THREE.Color(...data.tone), motion = new Float64Array(8 * data.bodies.length);
    if (ghost) tone.lerp(new THREE.Color(0.10, 0.16, 0.45), 0.65);
    const geometry = new THREE.BufferGeometry(), attribute = () => new THREE.BufferAttribute(new Float32Array(3 * rest.count), 3);
    const position = attribute(), normal = attribute(), colour = attribute();
    position.array.set(rest.points);
    Object.entries({position, normal, color: colour}).forEach(([name, of]) => geometry.setAttribute(name, of));
    geometry.setIndex(new THREE.BufferAttribute(rest.faces, 1));
    geometry.computeVertexNormals();
    const normals = normal.array.slice();
    const look = {vertexColors: THREE.VertexColors};
    const material = plain ? new THREE.MeshLambertMaterial(look) : new THREE.MeshPhongMaterial({...look, specular: 0x1c1614, shininess: 22});
    // A transparent skin shows only what is in front: its depth is drawn first.
    const meshes = [new THREE.MeshBasicMaterial({colorWrite: false, transparent: true}), material].map(of => new THREE.Mesh(geometry, of)), [front, mesh] = meshes;
    for (const each of meshes) each.frustumCulled = false;
    mesh.receiveShadow = !ghost;
    front.renderOrder = 1;
    const back = data.rest.map(x => ({q: new THREE.Quaternion(...x.slice(3)).conjugate(), p: new THREE.Vector3(...x.slice(0, 3)).negate()}));
    const q = new THREE.Quaternion(), p = new THREE.Vector3();
    let swell = 0;
    return {
      hand: data.hand,
      tone,
      meshes,
      covers: body => data.bodies.includes(body),
      /** Least distance of its points to one in the world [m]. */
      gap(point) {
        let least = Infinity;
        for (let i = 0; i < rest.count; ++i) least = Math.min(least, p.fromArray(position.array, 3 * i).distanceTo(point));
        return least;
      },
      /** Bends it as the groups stand now. */
      update() {
        if (!mesh.visible) return;
        data.bodies.forEach((body, i) => {
          const group = groups[body];
          q.copy(group.quaternion).multiply(back[i].q);
          p.copy(back[i].p).applyQuaternion(q).add(group.position).multiplyScalar(0.5);
          motion.set([q.x, q.y, q.z, q.w, q.w * p.x + p.y * q.z - p.z * q.y, q.w * p.y + p.z * q.x - p.x * q.z, q.w * p.z + p.x * q.y - p.y * q.x,
            -p.x * q.x - p.y * q.y - p.z * q.z], 8 * i);
        });
        bend(rest, normals, motion, swell, position.array, normal.array);
        position.needsUpdate = normal.needsUpdate = true;
      },
      /** @param seen at all. @param over true if the shapes show through it */
      show(seen, over) {
        const glass = over || ghost;
        // Shapes reach out of it by up to a millimetre.
        swell = over ? 0.0015 : 0;
        mesh.visible = seen;
        front.visible = seen && glass;
        Object.assign(material, {transparent: glass, opacity: ghost ? 0.4 : glass ? 0.5 : 1, depthWrite: !glass});
        mesh.castShadow = !glass;
        mesh.renderOrder = glass ? 2 : 0;
      },
      /** @param coloured fingers. @param picked body or null. @param hidden true of the bodies that are not seen */
      paint(coloured, picked, hidden) {
        const tints = data.bodies.map(body => (coloured && colours[body] || tone).clone().add(new THREE.Color(...(body === picked ? [0.16, 0.13, 0] : [0, 0, 0]))));
        colour.array.fill(0);
        for (let k = 0; k < 4 * rest.count; ++k) {
          const tint = tints[rest.bodies[k]], to = 3 * (k >> 2);
          colour.array[to] += rest.shares[k] * tint.r;
          colour.array[to + 1] += rest.shares[k] * tint.g;
          colour.array[to + 2] += rest.shares[k] * tint.b;
        }
        colour.needsUpdate = true;
        const gone = data.bodies.map(hidden), faces = rest.faces;
        geometry.setIndex(new THREE.BufferAttribute(gone.some(Boolean) ? faces.filter((_, i) => !gone[rest.bodies[4 * faces[i - i % 3]]]) : faces, 1));
      },
    };
  }

  return {create};
})();
