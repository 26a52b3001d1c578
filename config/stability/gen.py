import math
def w(name, text): open(name+'.yaml','w').write(text)
w('stack','''title: a heavy box on four light ones
objects:
'''+''.join(f'  - {{name: box{i}, shape: box, edges: [0.04, 0.04, 0.04], mass: 0.1, position: [0, 0, {0.02+0.04*i:.2f}], friction: 0.5}}\n' for i in range(5))+'''ground: {friction: 0.5}
effects: [gravity, object_contact, ground_contact, friction]
duration: "10 s"
''')
w('incline','''# The plane is level and gravity leans: the box starts as deep in it as contacts rest.
title: a box on an incline
objects:
  - {name: box, shape: box, edges: [0.04, 0.04, 0.04], mass: 0.1, position: [0, 0, 0.01999], friction: 0.5}
ground: {friction: 0.5}
gravity: [0, 0, -9.81]
effects: [gravity, ground_contact, friction]
duration: "1 s"
''')
w('ball_on_incline','''title: a ball rolls down an incline
objects:
  - {name: ball, shape: sphere, radius: 0.05, mass: 1, position: [0, 0, 0.04999], friction: 0.8}
ground: {friction: 0.8}
gravity: [0, 0, -9.81]
effects: [gravity, ground_contact, friction]
duration: "1 s"
''')
w('board_on_balls','''# Gravity leans so that 150 N act on the board along the diagonal; without slip, by Lagrange, board (M) and n balls (m)
# go v = a (M + n m / 2) / (M + 7 n m / 20) t.
title: a board on 25 balls is pushed along the diagonal
objects:
  - {name: board, shape: box, edges: [2, 2, 0.1], mass: 50, position: [0, 0, 0.14998], friction: 0.8}
'''+''.join(f'  - {{name: ball{5*i+k}, shape: sphere, radius: 0.05, mass: 1, position: [{0.3*(i-2):.1f}, {0.3*(k-2):.1f}, 0.04999], friction: 0.8}}\n' for i in range(5) for k in range(5))+'''ground: {friction: 0.8}
gravity: [2.1213203, 2.1213203, -9.81]
effects: [gravity, object_contact, ground_contact, friction]
duration: "0.5 s"
''')
w('bouncing_balls','''title: 49 balls bounce without loss
objects:
'''+''.join(f'  - {{name: ball{7*i+k}, shape: sphere, radius: 0.05, mass: 1, position: [{0.3*i:.1f}, {0.3*k:.1f}, {0.5+0.02*(7*i+k):.2f}], restitution: 1}}\n' for i in range(7) for k in range(7))+'''ground: {restitution: 1}
effects: [gravity, ground_contact]
duration: "20 s"
''')
w('stop_at_zero','''# A fingertip's worth of inertia rests on a stop at exactly 0 and is driven away from it.
title: a finger leaves a stop at zero
bodies:
  - {name: phalanx, mass: "11.2 g", inertia: [3e-6, 5e-7, 3e-6], position: [0, 0.02, 0], shape: {kind: capsule, radius: 0.008, length: 0.03, rotation: {axis: [1, 0, 0], angle: "90 deg"}}}
joints:
  - {name: pip, type: hinge, parent: world, child: phalanx, position: [0, 0, 0], axes: [{name: flexion, axis: [1, 0, 0], range: [0, 1.5], torque: 0.001}]}
effects: [joint_stops, actuation]
duration: "50 ms"
''')
w('hand_leaves_stops','''title: a controlled hand leaves its stops at zero
hands:
  - {model: ../../handmodels/anatomical.yaml, person: ../persons/median_man.yaml, side: right}
control: {controller: ../../controllers/implicit.yaml, poses: ../../controllers/poses.yaml, program: every_pose}
effects: [joint_stops, passive_tissue, actuation]
duration: "1 s"
''')
w('stop_near_half_turn','''title: a door hits a stop just short of half a turn
bodies:
  - {name: door, mass: 0.1, inertia: [1e-4, 1e-4, 1e-4], position: [0, 0.05, 0], angular_velocity: [50, 0, 0], velocity: [0, 0, 2.5], shape: {kind: box, edges: [0.02, 0.1, 0.02]}}
joints:
  - {name: hinge, type: hinge, parent: world, child: door, position: [0, 0, 0], axes: [{name: angle, axis: [1, 0, 0], range: [-3.14, 3.14], bounce: 0.5}]}
effects: [joint_stops]
duration: "1 s"
''')
w('universal_sweep','''# No force acts; the link turns about both axes.
title: a universal joint is swept through every angle
bodies:
  - {name: link, mass: 0.1, inertia: [8e-5, 1e-5, 8e-5], position: [0, 0.05, 0], angular_velocity: [0.7, 0, 1], velocity: [-0.05, 0, 0.035], shape: {kind: capsule, radius: 0.01, length: 0.08, rotation: {axis: [1, 0, 0], angle: "90 deg"}}}
joints:
  - {name: cross, type: universal, parent: world, child: link, position: [0, 0, 0], axes: [{name: turn, axis: [0, 0, 1]}, {name: swing, axis: [1, 0, 0]}]}
effects: []
duration: "10 s"
''')
def crank(name, title, phi, speed, redundant, torque='', force=''):
    r,l=0.02,0.06
    px,py=r*math.cos(phi),r*math.sin(phi)
    sx=px+math.sqrt(l*l-py*py)
    # rates at the start
    wr=-speed*r*math.cos(phi)/math.sqrt(l*l-py*py)
    vp=(-speed*py, speed*px)
    dx,dy=sx-px,-py
    vs=(vp[0]-wr*dy, 0)
    vrod=((vp[0]+vs[0])/2, (vp[1]+vs[1])/2)
    f=lambda x: f'{x:.15g}'
    pin = 'type: hinge' if redundant else 'type: ball'
    pina = ', axes: [{name: pin, axis: [0, 0, 1]}]' if redundant else ''
    if redundant: cross='type: hinge, parent: slider, child: rod, position: [%s, 0, 0], axes: [{name: swing, axis: [0, 0, 1]}]'%f(sx)
    else: cross='type: universal, parent: slider, child: rod, position: [%s, 0, 0], axes: [{name: swing, axis: [0, 0, 1]}, {name: roll, axis: [%s, %s, 0]}]'%(f(sx),f(dx/l),f(dy/l))
    act = ', actuation' if (torque or force) else ''
    w(name, f'''title: {title}
bodies:
  - {{name: crank, mass: 0.5, inertia: [1e-3, 1e-3, 1e-3], position: [{f(px/2)}, {f(py/2)}, 0], z_axis: [{f(px)}, {f(py)}, 0], velocity: [{f(vp[0]/2)}, {f(vp[1]/2)}, 0], angular_velocity: [0, 0, {f(speed)}], shape: {{kind: capsule, radius: 0.004, length: {r}}}}}
  - {{name: slider, mass: 0.1, inertia: [1e-5, 1e-5, 1e-5], position: [{f(sx)}, 0, 0], velocity: [{f(vs[0])}, 0, 0], shape: {{kind: box, edges: [0.02, 0.015, 0.015]}}}}
  - {{name: rod, mass: 0.05, inertia: [1.5e-5, 1.5e-5, 1e-6], position: [{f((px+sx)/2)}, {f(py/2)}, 0], z_axis: [{f(dx)}, {f(dy)}, 0], velocity: [{f(vrod[0])}, {f(vrod[1])}, 0], angular_velocity: [0, 0, {f(wr)}], shape: {{kind: capsule, radius: 0.003, length: {l}}}}}
joints:
  - {{name: pivot, type: hinge, parent: world, child: crank, position: [0, 0, 0], axes: [{{name: angle, axis: [0, 0, 1]{torque}}}]}}
  - {{name: slide, type: slider, parent: world, child: slider, position: [{f(sx)}, 0, 0], axes: [{{name: x, axis: [1, 0, 0]{force}}}]}}
  - {{name: cross, {cross}}}
  - {{name: pin, {pin}, parent: crank, child: rod, position: [{f(px)}, {f(py)}, 0]{pina}}}
effects: [{act.strip(', ')}]
duration: "20 s"
pictures: {{camera: {{position: [0.03, -0.12, 0.2], target: [0.03, 0, 0], field_of_view: "35 deg"}}}}
''')
for s in (1,10,100):
    crank(f'crank_{s}', f'slider-crank of 20 and 60 mm at {s} rad/s', math.pi/2, s, False)
    crank(f'crank_{s}_redundant', f'the same with three parallel hinges, {s} rad/s', math.pi/2, s, True)
crank('crank_outer_dead_centre','slider-crank at rest in one line, its slider pushed',0,0,False,force=', torque: -1')
crank('crank_inner_dead_centre','slider-crank at rest folded over, its slider pushed',math.pi,0,False,force=', torque: 1')
crank('crank_driven_off','slider-crank at rest in one line, its crank driven',0,0,False,torque=', torque: 0.02')
for fk,shape in (('pads','{kind: box, edges: [0.01, 0.03, 0.03]}'),('capsules','{kind: capsule, radius: 0.008, length: 0.03, rotation: {axis: [1, 0, 0], angle: "90 deg"}}')):
    half=0.005 if fk=='pads' else 0.008
    w('pinch_'+fk, f'''# Fingers on slides press with a constant force; the limit of friction is m g / (2 mu) = 0.315 N.
title: an object of 45 g between two fingers ({fk})
bodies:
  - {{name: left, mass: 0.02, inertia: [5e-6, 5e-6, 5e-6], position: [{-(0.02+half)+1e-5:.5f}, 0, 0.1], shape: {shape}, collides: true, friction: 0.7}}
  - {{name: right, mass: 0.02, inertia: [5e-6, 5e-6, 5e-6], position: [{0.02+half-1e-5:.5f}, 0, 0.1], shape: {shape}, collides: true, friction: 0.7}}
joints:
  - {{name: left_slide, type: slider, parent: world, child: left, position: [0, 0, 0.1], axes: [{{name: x, axis: [1, 0, 0], torque: 1}}]}}
  - {{name: right_slide, type: slider, parent: world, child: right, position: [0, 0, 0.1], axes: [{{name: x, axis: [-1, 0, 0], torque: 1}}]}}
objects:
  - {{name: thing, shape: sphere, radius: 0.02, mass: "45 g", position: [0, 0, 0.1], friction: 0.7}}
effects: [gravity, object_contact, friction, actuation]
duration: "10 s"
''')
w('resting_capsule','''title: a capsule lies on a box
objects:
  - {name: table, shape: box, edges: [0.3, 0.3, 0.02], position: [0, 0, -0.01], static: true}
  - {name: capsule, shape: capsule, radius: 0.01, length: 0.04, mass: 0.02, position: [0, 0, 0.01], rotation: {axis: [1, 0, 0], angle: "90 deg"}}
effects: [gravity, object_contact, friction]
duration: "5 s"
''')
w('resting_stack','''title: three boxes rest on each other
objects:
'''+''.join(f'  - {{name: box{i}, shape: box, edges: [0.04, 0.04, 0.04], mass: 0.1, position: [0, 0, {0.02+0.04*i:.2f}]}}\n' for i in range(3))+'''ground: {}
effects: [gravity, object_contact, ground_contact, friction]
duration: "5 s"
''')
w('limp_hands','''title: two limp hands fall open
hands:
  - {model: ../../handmodels/anatomical.yaml, person: ../persons/median_man.yaml, side: right, wrist: {mount: universal, position: [0.1, 0, 0.25]}}
  - {model: ../../handmodels/anatomical.yaml, person: ../persons/median_man.yaml, side: left, wrist: {mount: universal, position: [-0.1, 0, 0.25]}}
effects: [gravity, joint_stops, passive_tissue]
duration: "2 s"
''')
w('controlled_hand','''title: a hand is driven through every pose
hands:
  - {model: ../../handmodels/anatomical.yaml, person: ../persons/median_man.yaml, side: right}
control: {controller: ../../controllers/implicit.yaml, poses: ../../controllers/poses.yaml, program: every_pose}
effects: [gravity, joint_stops, passive_tissue, actuation]
duration: "16 s"
''')
w('falling_object','''title: a ball falls onto a hand that lies on the ground
hands:
  - {model: ../../handmodels/anatomical.yaml, person: ../persons/median_man.yaml, side: right, wrist: {mount: free, position: [0, 0, 0.03]}}
objects:
  - {name: ball, shape: sphere, radius: "20 mm", mass: 0.1, position: [0, 0.05, 0.12]}
ground: {}
effects: [gravity, object_contact, ground_contact, friction, joint_stops, passive_tissue]
solver: {cfm: 1e-7}
duration: "1 s"
''')
w('crossed_fingers','''title: index and middle finger start inside each other
hands:
  - model: ../../handmodels/anatomical.yaml
    person: ../persons/median_man.yaml
    side: right
    tissue: {stiffness: 0}      # that would straighten or bend fingers by itself
    pose: {index_mcp: ["30 deg", "-15 deg"], middle_mcp: ["30 deg", "15 deg"]}
effects: [self_contact, friction, joint_stops, passive_tissue]
duration: "1 s"
''')
w('pendulum','''title: a pendulum swings from the level
bodies:
  - {name: bob, mass: 0.1, inertia: [8.3333e-5, 1e-6, 8.3333e-5], position: [0, 0.05, 0], shape: {kind: capsule, radius: 0.01, length: 0.08, rotation: {axis: [1, 0, 0], angle: "90 deg"}}}
joints:
  - {name: pin, type: hinge, parent: world, child: bob, position: [0, 0, 0], axes: [{name: swing, axis: [1, 0, 0]}]}
effects: [gravity]
duration: "60 s"
''')
w('poses_of_a_hand','''title: a controlled hand, half a second
hands:
  - {model: ../../handmodels/anatomical.yaml, person: ../persons/median_man.yaml, side: right}
control: {controller: ../../controllers/implicit.yaml, poses: ../../controllers/poses.yaml, program: every_pose}
effects: [gravity, actuation]
duration: "0.5 s"
''')
w('free_hand','''title: a hand without stops, tissue and contact
hands:
  - {model: ../../handmodels/anatomical.yaml, person: ../persons/median_man.yaml, side: right, wrist: {mount: universal}}
effects: []
duration: "1 s"
''')
w('hanging_hand','''title: a hand hangs at rest from its wrist
hands:
  - model: ../../handmodels/anatomical.yaml
    person: ../persons/median_man.yaml
    side: right
    wrist: {mount: universal, rotation: {axis: [1, 0, 0], angle: "-90 deg"}}
    tissue: {damping: 5}
effects: [gravity, joint_stops, passive_tissue]
duration: "20 s"
''')
w('dropped_hands','''title: two hands are dropped
hands:
  - {model: ../../handmodels/anatomical.yaml, person: ../persons/median_man.yaml, side: right, wrist: {mount: free, position: [0.12, 0, 0.1], rotation: {axis: [1, 0, 0], angle: "-20 deg"}}}
  - {model: ../../handmodels/anatomical.yaml, person: ../persons/median_man.yaml, side: left, wrist: {mount: free, position: [-0.12, 0, 0.1], rotation: {axis: [1, 0, 0], angle: "-20 deg"}}}
ground: {}
effects: [gravity, ground_contact, friction, joint_stops, passive_tissue]
solver: {cfm: 1e-7}
duration: "0.5 s"
''')
def keys(x):
    out=[]
    for i in range(11):
        z=0.3+(0.04 if i%2 else 0)
        out.append(f'        - {{time: {0.1*i:.1f}, position: [{x}, 0, {z:.2f}]}}')
    return '\n'.join(out)
w('closed_and_shaken','''title: two hands close while they are shaken
hands:
  - model: ../../handmodels/anatomical.yaml
    person: ../persons/median_man.yaml
    side: right
    wrist:
      mount: driven
      motion:
       keyframes:
'''+keys(0.12)+'''
  - model: ../../handmodels/anatomical.yaml
    person: ../persons/median_man.yaml
    side: left
    wrist:
      mount: driven
      motion:
       keyframes:
'''+keys(-0.12)+'''
control: {controller: ../../controllers/implicit.yaml, poses: closing.yaml, program: close}
effects: [gravity, self_contact, friction, joint_stops, passive_tissue, actuation, wrist_motion]
solver: {cfm: 1e-7}
duration: "1 s"
''')
w('thumb_cmc','''# The universal joint of a thumb, its ranges those of the anatomical hand, pressed into both upper stops.
title: a thumb's root is driven into both stops at once
bodies:
  - {name: metacarpal, mass: "20 g", inertia: [8e-6, 2e-6, 8e-6], position: [0, 0.024, 0], shape: {kind: capsule, radius: 0.011, length: 0.03, rotation: {axis: [1, 0, 0], angle: "90 deg"}}}
joints:
  - name: cmc
    type: universal
    parent: world
    child: metacarpal
    position: [0, 0, 0]
    axes:
      - {name: flexion, axis: [-1, 0, 0], range: ["-45 deg", "15 deg"], torque: 0.02}
      - {name: abduction, axis: [0, 0, 1], range: ["-25 deg", "25 deg"], torque: 0.02}
effects: [joint_stops, actuation]
duration: "1 s"
''')
w('stops_at_zero','''# Every joint starts on a stop at exactly 0; gravity presses the first ones on, lets the others go.
title: a finger whose stops all stand at zero
bodies:
'''+''.join(f'  - {{name: link{i}, mass: 0.02, inertia: [3e-6, 5e-7, 3e-6], position: [0, {0.02+0.04*i:.2f}, 0], shape: {{kind: capsule, radius: 0.008, length: 0.03, rotation: {{axis: [1, 0, 0], angle: "90 deg"}}}}}}\n' for i in range(4))+'''joints:
  - {name: root, type: universal, parent: world, child: link0, position: [0, 0, 0], axes: [{name: flexion, axis: [-1, 0, 0], range: [0, 1.5]}, {name: abduction, axis: [0, 0, 1], range: [-0.5, 0]}]}
  - {name: pip, type: hinge, parent: link0, child: link1, position: [0, 0.04, 0], axes: [{name: flexion, axis: [-1, 0, 0], range: [-1.5, 0]}]}
  - {name: dip, type: hinge, parent: link1, child: link2, position: [0, 0.08, 0], axes: [{name: flexion, axis: [-1, 0, 0], range: [0, 1.5]}]}
  - {name: tip, type: hinge, parent: link2, child: link3, position: [0, 0.12, 0], axes: [{name: flexion, axis: [-1, 0, 0], range: [-1.5, 0]}]}
effects: [gravity, joint_stops]
duration: "2 s"
''')

w('closing','''title: an open hand closes to a fist
unit: deg
poses:
  open: {index_pip: 2, middle_pip: 2, ring_pip: 2, little_pip: 2}
  fist: {thumb_cmc: [14.5, 20], thumb_mcp: 38, thumb_ip: 70, index_mcp: [88, 0], index_pip: 98, index_dip: 72, middle_mcp: [88, 0], middle_pip: 98, middle_dip: 72, ring_mcp: [88, 0], ring_pip: 98, ring_dip: 72, little_mcp: [88, 0], little_pip: 98, little_dip: 72}
programs:
  close: {move: 0.4, keys: [{time: 0, pose: open}, {time: 0.4, pose: fist}]}
''')
w('limp_prototype','''title: the prototype's hands fall open
hands:
  - {model: ../../handmodels/prototype.yaml, person: ../persons/median_man.yaml, side: right, wrist: {mount: hinge, position: [0.1, 0, 0.25]}}
  - {model: ../../handmodels/prototype.yaml, person: ../persons/median_man.yaml, side: left, wrist: {mount: hinge, position: [-0.1, 0, 0.25]}}
effects: [gravity, joint_stops]
duration: "10 s"
''')
