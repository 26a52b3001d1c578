import math
g=9.81
def grav(deg,head):
    a=math.radians(deg); b=math.radians(head)
    return f'[{g*math.sin(a)*math.cos(b):.6f}, {g*math.sin(a)*math.sin(b):.6f}, {-g*math.cos(a):.6f}]'
def inclines(degs):
    return '\n'.join(f'          - {{name: {d} deg heading {h} deg, set: {{gravity: {grav(d,h)}}}}}' for d in degs for h in (0,22.5,45,90))
text='''# Hard cases for engines that simulate hands. Every case is run by every way at every step and variant; a figure beyond
# its limit fails the suite, unless the way is known to fall short of it, and then something else in the case must hold.
title: hard cases
shared:
  smooth: &smooth
    - {name: ODE world_step, set: {solver.method: world_step}}
    - {name: ODE quick_step 20, set: {solver.method: quick_step}}
    - {name: DAE stabilised_gear 1e-10, set: {solver.engine: dae, solver.method: stabilised_gear, solver.tolerance: 1e-10}}
    - {name: articulated semi_implicit_euler, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
    - {name: articulated rk4, set: {solver.engine: articulated, solver.method: rk4}}
    - {name: articulated dormand_prince, set: {solver.engine: articulated, solver.method: dormand_prince}}
  hard: &hard
    - {name: ODE world_step, set: {solver.method: world_step}}
    - {name: ODE quick_step 50, set: {solver.method: quick_step, solver.iterations: 50}}
    - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
  dissipates: &dissipates ODE's gyroscopic term is of first order and dissipates
  explicit: &explicit the gyroscopic term is explicit, and the method of first order
cases:
  - name: free_spin
    title: a block spins about its middle axis for 10 and 100 s
    oracle: conservation of energy and angular momentum
    scene: stability/free_spin.yaml
    steps: ["1 ms"]
    vary: [{key: duration, values: ["10 s", "100 s"]}]
    measures:
      - {measure: energy_gain, limit: 1e-9}
      - {measure: energy_loss, limit: 0.3}
      - {measure: energy_error, limit: 1e-8}
      - {measure: momentum_error, limit: 1e-8}
    ways: *smooth
    plot: energy_error
    quick: {set: {duration: "2 s"}}
  - name: fingertip_spin
    title: a fingertip's capsule spins freely
    oracle: conservation of energy
    scene: stability/fingertip_spin.yaml
    steps: ["1 ms", "5 ms"]
    measures: [{measure: energy_gain, limit: 1e-9}]
    ways: *smooth
    quick: {set: {duration: "2 s"}}
  - name: pendulum
    title: a pendulum swings for a minute
    oracle: conservation of energy, in the limit of small steps
    scene: stability/pendulum.yaml
    steps: ["1 ms"]
    measures:
      - {measure: joint_gap, limit: "0.1 mm"}
      - {measure: energy_order, limit: 1, ladder: ["4 ms", "2 ms", "1 ms", "0.5 ms"]}
    ways: *smooth
    plot: energy_order
    quick: {set: {duration: "2 s"}}
  - name: chain
    title: a chain of five links falls from the level and swings for a minute
    oracle: joints hold together
    scene: stability/chain.yaml
    steps: ["1 ms"]
    measures: [{measure: joint_gap, limit: "0.1 mm"}]
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}, steps: ["1 ms", "0.1 ms"]}
      - {name: ODE quick_step 50, set: {solver.method: quick_step, solver.iterations: 50}}
      - {name: ODE world_step with projection, set: {solver.projection: true}}
      - {name: articulated semi_implicit_euler, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
      - {name: articulated dormand_prince, set: {solver.engine: articulated, solver.method: dormand_prince}}
    plot: joint_gap
    picture: "0.15 s"
    quick: {set: {duration: "2 s"}, steps: ["1 ms"]}
  - name: convergence
    title: a controlled hand moves for half a second
    oracle: its own smallest step
    scene: stability/poses_of_a_hand.yaml
    steps: ["1 ms"]
    measures: [{measure: convergence, limit: 1, ladder: ["2 ms", "1 ms", "0.5 ms", "0.2 ms", "0.1 ms", "0.05 ms", "0.01 ms"]}]
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE world_step with projection, set: {solver.projection: true}, quick: false}
      - {name: articulated semi_implicit_euler, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
    plot: convergence
  - name: stack
    title: five boxes, the top one up to 1000 times as heavy
    oracle: a stack at rest stays
    scene: stability/stack.yaml
    steps: ["1 ms"]
    vary: [{key: objects.4.mass, label: top, values: [0.1, 1, 10, 100]}]
    measures:
      - {measure: penetration, limit: "0.1 mm", from: 0.5}
      - {measure: drift, limit: "1 mm"}
      - {measure: lcp_failures, limit: 0}
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE world_step guarded, set: {solver.cfm: 1e-7, effects: [gravity, object_contact, ground_contact, friction, step_guard]}}
      - {name: ODE quick_step 20, set: {solver.method: quick_step}}
      - {name: ODE quick_step 200, set: {solver.method: quick_step, solver.iterations: 200}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
    plot: penetration
    picture: 0
    quick: {set: {duration: "1 s"}}
  - name: incline_sticks
    title: a box on an incline below the angle of friction, 26.57 degrees, in four directions
    oracle: Coulomb's law
    scene: stability/incline.yaml
    steps: ["1 ms", "5 ms"]
    vary:
      - of:
'''+inclines((20,26))+'''
    measures: [{measure: creep, body: box, from: 0.1, limit: "1 um/s"}]
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE world_step guarded, set: {effects: [gravity, ground_contact, friction, step_guard]}}
      - {name: ODE quick_step 50, set: {solver.method: quick_step, solver.iterations: 50}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
  - name: incline_slides
    title: a box on an incline above the angle of friction
    oracle: Coulomb's law, speed g (sin a - mu cos a) t
    scene: stability/incline.yaml
    steps: ["1 ms"]
    vary:
      - of:
'''+inclines((27,35))+'''
    measures: [{measure: slide_error, body: box, limit: 5e-4}]
    ways: *hard
    plot: slide_error
  - name: ball_on_incline
    title: a ball rolls down 15 degrees, in four directions
    oracle: rolling without slip, speed 5/7 g sin a t
    scene: stability/ball_on_incline.yaml
    steps: ["1 ms"]
    vary:
      - of:
'''+inclines((15,))+'''
    measures: [{measure: roll_error, body: ball, limit: 5.5e-4}]
    ways: *hard
  - name: board_on_balls
    title: a board on 25 balls is pushed along the diagonal
    oracle: rolling without slip, by Lagrange
    scene: stability/board_on_balls.yaml
    steps: ["1 ms"]
    measures: [{measure: speed_error, body: board, expected: 1.595745, limit: 5.5e-4}]
    ways: *hard
    picture: 0
    quick: false
  - name: bouncing_balls
    title: 49 balls bounce without loss for 20 s
    oracle: conservation of energy
    scene: stability/bouncing_balls.yaml
    steps: ["1 ms"]
    measures: [{measure: energy_error, limit: 0.01}]
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE world_step, set: {solver.method: world_step}, steps: ["0.1 ms"], quick: false}
      - {name: ODE quick_step 20, set: {solver.method: quick_step}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
      - {name: articulated, set: {solver.engine: articulated}, steps: ["0.1 ms"], quick: false}
    plot: energy_error
    picture: 0
    quick: {set: {duration: "1 s"}}
  - name: stop_impact
    title: a door hits its stop at 10, 50 and 200 rad/s
    oracle: Newton's law of restitution; a stop is a stop
    scene: stability/stop_impact.yaml
    steps: ["1 ms", "5 ms"]
    vary:
      - of:
          - {name: 10 rad/s, set: {bodies.0.angular_velocity: [10, 0, 0], bodies.0.velocity: [0, 0, 0.5]}}
          - {name: 50 rad/s, set: {bodies.0.angular_velocity: [50, 0, 0], bodies.0.velocity: [0, 0, 2.5]}}
          - {name: 200 rad/s, set: {bodies.0.angular_velocity: [200, 0, 0], bodies.0.velocity: [0, 0, 10]}}
      - {key: solver.erp, values: [0.2, 0.8]}
      - {key: joints.0.axes.0.bounce, values: [0, 0.5]}
    measures:
      - {measure: stop_overshoot, limit: 1e-6}
      - {measure: stop_late, joint: hinge, limit: 1e-3}
      - {measure: rebound_error, joint: hinge, limit: 0.05}
    ways: *hard
  - name: stop_at_zero
    title: a finger starts on a stop at exactly 0 and is driven away
    oracle: the same without stops
    scene: stability/stop_at_zero.yaml
    steps: ["1 ms", "5 ms"]
    vary: [{key: solver.erp, values: [0.2, 0.8]}]
    measures: [{measure: release_ratio, joint: pip, limit: 1.05}]
    ways: *hard
  - name: hand_leaves_stops
    title: a controlled hand starts on its stops at exactly 0
    oracle: the same without stops
    scene: stability/hand_leaves_stops.yaml
    steps: ["1 ms", "5 ms"]
    measures:
      - {measure: release_ratio, name: index, joint: right.index_pip, limit: 1.05}
      - {measure: release_ratio, name: little, joint: right.little_dip, limit: 1.05}
    ways: *hard
  - name: stop_near_half_turn
    title: a door bounces between stops just short of half a turn
    oracle: an angle within a range does not jump
    scene: stability/stop_near_half_turn.yaml
    steps: ["1 ms", "5 ms"]
    measures: [{measure: wraps, joint: hinge, limit: 0}]
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE quick_step 20, set: {solver.method: quick_step}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
      - {name: range of nothing, set: {joints.0.axes.0.range: [1, 1]}, refused: range}
      - {name: range upside down, set: {joints.0.axes.0.range: [1, -1]}, refused: range}
      - {name: range without number, set: {joints.0.axes.0.range: [.nan, 1]}, refused: range}
  - name: universal_sweep
    title: a universal joint is swept through every angle
    oracle: its axes stay perpendicular, its rates smooth
    scene: stability/universal_sweep.yaml
    steps: ["1 ms"]
    measures:
      - {measure: axis_error, limit: 1e-4}
      - {measure: rate_jump, name: turn_jump, joint: cross.turn, limit: 0.1}
      - {measure: rate_jump, name: swing_jump, joint: cross.swing, limit: 0.1}
    ways: *smooth
    quick: {set: {duration: "1 s"}}
  - name: crank
    title: a slider-crank goes through both dead centres for 20 s, also with redundant joints
    oracle: the slider's place in closed form; joints hold together
    scenes: [stability/crank_1.yaml, stability/crank_10.yaml, stability/crank_1_redundant.yaml, stability/crank_10_redundant.yaml]
    steps: ["1 ms"]
    measures: &crank_measures
      - {measure: joint_gap, limit: "0.01 mm"}
      - {measure: slider_error, joint: pivot, body: slider, crank: "20 mm", rod: "60 mm", crank_angle: "90 deg", limit: "0.02 mm"}
    ways: &crank_ways
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE quick_step 20, set: {solver.method: quick_step}}
      - {name: ODE world_step with projection, set: {solver.projection: true}}
      - {name: DAE euler_projected, set: {solver.engine: dae, solver.method: euler_projected}}
      - {name: articulated semi_implicit_euler, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
      - {name: articulated rk4, set: {solver.engine: articulated, solver.method: rk4}}
    plot: slider_error
    picture: "0.1 s"
    quick: {set: {duration: "1 s"}}
  - name: crank_fast
    title: the slider-crank at 100 rad/s, 2 s
    oracle: the slider's place in closed form; joints hold together
    scenes: [stability/crank_100.yaml, stability/crank_100_redundant.yaml]
    set: {duration: "2 s"}
    steps: ["1 ms", "0.1 ms"]
    measures: *crank_measures
    ways: *crank_ways
    quick: {set: {duration: "0.2 s"}}
  - name: crank_at_dead_centre
    title: a slider-crank at rest in one line or folded over; its slider is pushed or its crank driven
    oracle: joints hold together
    scenes: [stability/crank_outer_dead_centre.yaml, stability/crank_inner_dead_centre.yaml, stability/crank_driven_off.yaml]
    set: {duration: "2 s"}
    steps: ["1 ms"]
    measures: [{measure: joint_gap, limit: "0.01 mm"}]
    ways: *crank_ways
    quick: {set: {duration: "0.5 s"}}
  - name: pinch
    title: an object of 45 g between two fingers that press with 1.05 to 38 times the limit of friction
    oracle: Coulomb's law; what is held does not slip
    scenes: [stability/pinch_pads.yaml, stability/pinch_capsules.yaml]
    steps: ["1 ms"]
    vary: &pinch_variants
      - of:
          - {name: sphere, set: {objects.0.shape: sphere}}
          - {name: box, set: {objects.0: {name: thing, shape: box, edges: [0.04, 0.04, 0.04], mass: 0.045, position: [0, 0, 0.1], friction: 0.7}}}
          - {name: capsule, set: {objects.0: {name: thing, shape: capsule, radius: 0.02, length: 0.04, mass: 0.045, position: [0, 0, 0.1], friction: 0.7}}}
          - {name: cylinder, set: {objects.0: {name: thing, shape: cylinder, radius: 0.02, length: 0.06, mass: 0.045, position: [0, 0, 0.1], friction: 0.7}}}
      - of:
          - {name: force 1.05, set: {joints.0.axes.0.torque: 0.331, joints.1.axes.0.torque: 0.331}}
          - {name: force 4, set: {joints.0.axes.0.torque: 1.26, joints.1.axes.0.torque: 1.26}}
          - {name: force 38, set: {joints.0.axes.0.torque: 12, joints.1.axes.0.torque: 12}}
    measures:
      - {measure: slip_speed, body: thing, from: 2, limit: "1.4 um/s"}
      - {measure: turn, body: thing, limit: "2 deg"}
    ways:
      - {name: ODE world_step, set: {solver.method: world_step, solver.cfm: 1e-8}}
      - {name: ODE world_step guarded, set: {solver.cfm: 1e-8, effects: [gravity, object_contact, friction, actuation, step_guard]}}
      - {name: ODE quick_step 20, set: {solver.method: quick_step}}
      - {name: ODE quick_step 200, set: {solver.method: quick_step, solver.iterations: 200}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
    plot: slip_speed
    picture: 0
    quick: {set: {duration: "3 s"}}
  - name: mass_ratio
    title: an object of 45 g between fingers of 4.5 mg and of 450 kg
    oracle: Coulomb's law; what is held does not slip
    scene: stability/pinch_pads.yaml
    steps: ["1 ms"]
    set: {duration: "3 s"}
    vary:
      - of:
          - {name: sphere, set: {objects.0.shape: sphere}}
          - {name: box, set: {objects.0: {name: thing, shape: box, edges: [0.04, 0.04, 0.04], mass: 0.045, position: [0, 0, 0.1], friction: 0.7}}}
      - of:
          - {name: light fingers, set: {bodies.0.mass: 4.5e-6, bodies.1.mass: 4.5e-6}}
          - {name: heavy fingers, set: {bodies.0.mass: 450, bodies.1.mass: 450}}
    measures: [{measure: slip_speed, body: thing, from: 1, limit: "1.4 um/s"}]
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE world_step guarded, set: {solver.cfm: 1e-8, effects: [gravity, object_contact, friction, actuation, step_guard]}}
      - {name: ODE quick_step 200, set: {solver.method: quick_step, solver.iterations: 200}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
  - name: grasp_and_shake
    title: a hand grasps, lifts, holds and shakes nine objects in six directions at 0.5 to 2 g
    oracle: what is held moves by less than 2 mm and 2 degrees, as the grasp's epsilon says it must
    scenes: [grasp_pinch.yaml, grasp_tripod.yaml, grasp_sphere_35mm.yaml, grasp_sphere_70mm.yaml, grasp_cup.yaml, grasp_cylinder_50mm.yaml, grasp_power_can.yaml, grasp_cylinder_100mm.yaml, grasp_hook_bar.yaml]
    steps: ["1 ms"]
    measures:
      - {measure: grasp_shift, limit: "2 mm"}
      - {measure: grasp_turn, limit: "2 deg"}
      - {measure: grasp_slip, limit: "1.4 um/s"}
      - {measure: grasp_epsilon, limit: 1e-3}
    ways:
      - {name: ODE world_step guarded, set: {solver.method: world_step}}
      - {name: ODE quick_step 200, set: {solver.method: quick_step, solver.iterations: 200}}
    picture: "3 s"
    quick: false
  - name: resting_capsule
    title: a capsule lies on a box, a cylinder and a plane
    oracle: what rests is still
    scene: stability/resting_capsule.yaml
    steps: ["1 ms", "5 ms"]
    vary:
      - of:
          - {name: box, set: {objects.0.static: true}}
          - {name: cylinder, set: {objects.0: {name: table, shape: cylinder, radius: 0.1, length: 0.02, position: [0, 0, -0.01], static: true}}}
          - {name: plane, set: {objects.0: {name: table, shape: box, edges: [0.3, 0.3, 0.02], position: [0, 0, -1], static: true}, ground: {height: 0}, effects: [gravity, object_contact, ground_contact, friction]}}
    measures:
      - {measure: rms_speed, body: capsule, from: 1, limit: "10 um/s"}
      - {measure: penetration, from: 1, limit: "50 um"}
    ways: *hard
    picture: 1
    quick: {set: {duration: "2 s"}}
  - name: softness
    title: three boxes at rest, ERP 0.2 to 1, CFM 1e-10 to 1e-4
    oracle: what rests is still and does not sink
    scene: stability/resting_stack.yaml
    steps: ["1 ms"]
    vary: [{key: solver.erp, values: [0.2, 0.6, 0.8, 0.9, 1.0]}]
    measures:
      - {measure: rms_speed, from: 2, limit: "10 um/s"}
      - {measure: penetration, from: 0.5, limit: "0.1 mm"}
      - {measure: lcp_failures, limit: 0}
    ways:
      - {name: ODE world_step CFM 1e-10, set: {solver.cfm: 1e-10}}
      - {name: ODE world_step CFM 1e-8, set: {solver.cfm: 1e-8}}
      - {name: ODE world_step CFM 1e-6, set: {solver.cfm: 1e-6}}
      - {name: ODE world_step CFM 1e-5, set: {solver.cfm: 1e-5}}
      - {name: ODE world_step CFM 1e-4, set: {solver.cfm: 1e-4}}
      - {name: ODE world_step CFM 1e-8 guarded, set: {solver.cfm: 1e-8, effects: [gravity, object_contact, ground_contact, friction, step_guard]}}
      - {name: ODE quick_step 50 CFM 1e-8, set: {solver.method: quick_step, solver.iterations: 50, solver.cfm: 1e-8}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
    quick: {set: {duration: "2.5 s"}}
  - name: large_steps
    title: two limp hands at 5, 10 and 20 ms
    oracle: motion ends within the stops
    scene: stability/limp_hands.yaml
    steps: ["20 ms", "10 ms", "5 ms"]
    measures:
      - {measure: completes, limit: 0}
      - {measure: stop_overshoot, limit: 1e-3}
      - {measure: top_speed, limit: "10 m/s"}
    ways: *hard
  - name: controlled_large_steps
    title: a controlled hand through every pose at 5, 10 and 20 ms
    oracle: a held pose is held
    scene: stability/controlled_hand.yaml
    steps: ["20 ms", "10 ms", "5 ms"]
    measures: [{measure: steady_error, limit: "0.5 deg"}]
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE quick_step 50, set: {solver.method: quick_step, solver.iterations: 50}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
      - {name: explicit gains at 5 ms, set: {control.controller.form: explicit, solver.step: "5 ms"}, steps: ["5 ms"], refused: control}
    quick: {set: {duration: "2.4 s"}}
  - name: masses
    title: a ball of 1 mg to 1000 kg falls onto a hand that lies on the ground
    oracle: nothing is thrown faster than it fell, or the run ends in a fault
    scene: stability/falling_object.yaml
    steps: ["1 ms"]
    vary: [{key: objects.0.mass, values: [1e-6, 1e-3, 0.1, 10, 1000]}]
    measures:
      - {measure: completes, limit: 0}
      - {measure: top_speed, body: ball, limit: "2 m/s"}
    ways: *hard
    picture: "0.1 s"
  - name: small_and_large_hands
    title: hands of persons of 0.5 and 2.5 m fall limp
    oracle: joints and stops hold
    scene: stability/limp_hands.yaml
    steps: ["1 ms", "5 ms"]
    vary:
      - of:
          - {name: 0.5 m, set: {hands.0.person: {stature: 0.5, mass: 3.5, sex: male}, hands.1.person: {stature: 0.5, mass: 3.5, sex: male}}}
          - {name: 2.5 m, set: {hands.0.person: {stature: 2.5, mass: 200, sex: male}, hands.1.person: {stature: 2.5, mass: 200, sex: male}}}
    measures:
      - {measure: stop_rest, limit: 1e-3}
      - {measure: stop_overshoot, limit: 1e-4}
      - {measure: joint_gap, limit: "0.1 mm"}
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE quick_step 50, set: {solver.method: quick_step, solver.iterations: 50}}
      - {name: ODE world_step with projection, set: {solver.projection: true}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
    picture: "0.3 s"
  - name: crossed_fingers
    title: index and middle finger start inside each other, spread by 8 to 15 degrees the wrong way
    oracle: they part slowly
    scene: stability/crossed_fingers.yaml
    steps: ["1 ms", "5 ms"]
    vary:
      - of:
          - {name: 8 deg, set: {hands.0.pose: {index_mcp: ["30 deg", "-8 deg"], middle_mcp: ["30 deg", "8 deg"]}}}
          - {name: 12 deg, set: {hands.0.pose: {index_mcp: ["30 deg", "-12 deg"], middle_mcp: ["30 deg", "12 deg"]}}}
          - {name: 15 deg, set: {hands.0.pose: {index_mcp: ["30 deg", "-15 deg"], middle_mcp: ["30 deg", "15 deg"]}}}
      - {key: solver.erp, values: [0.2, 0.8]}
    measures:
      - {measure: first_speed, limit: "1 m/s"}
      - {measure: top_speed, limit: "1 m/s"}
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE quick_step 20, set: {solver.method: quick_step, solver.iterations: 20}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
    picture: 0
  - name: bad_input
    title: numbers that no simulation can use
    oracle: refused with a message; the process and other worlds go on
    scene: stability/pendulum.yaml
    steps: ["1 ms"]
    measures: [{measure: abuse, limit: 0}]
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE quick_step 20, set: {solver.method: quick_step}}
      - {name: DAE stabilised_gear, set: {solver.engine: dae, solver.method: stabilised_gear}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
      - {name: a step of 0, set: {solver.step: 0}, refused: solver.step}
      - {name: a step of NaN, set: {solver.step: .nan}, refused: solver.step}
      - {name: a mass of 0, set: {bodies.0.mass: 0}, refused: bodies.0.mass}
      - {name: a mass of -1, set: {bodies.0.mass: -1}, refused: bodies.0.mass}
      - {name: a mass of 1e300, set: {bodies.0.mass: 1e300}, refused: bodies.0.mass}
      - {name: an inertia of no body, set: {bodies.0.inertia: [1e-4, 1e-4, 3e-4]}, refused: inertia}
      - {name: a radius of 0, set: {bodies.0.shape: {kind: sphere, radius: 0}}, refused: radius}
      - {name: an axis of zeros, set: {joints.0.axes.0.axis: [0, 0, 0]}, refused: axis}
      - {name: a speed of 1e300, set: {bodies.0.velocity: [1e300, 0, 0]}, refused: velocity}
      - {name: an infinite place, set: {bodies.0.position: [.inf, 0, 0]}, refused: position}
      - {name: parallel universal axes, set: {joints.0.type: universal, joints.0.axes: [{name: a, axis: [1, 0, 0]}, {name: b, axis: [1, 0, 0]}]}, refused: perpendicular}
      - {name: a CFM of 0, set: {solver.cfm: 0}, refused: solver.cfm}
  - name: object_in_a_hand
    title: a ball starts inside a palm
    oracle: refused with the names of both
    scene: stability/falling_object.yaml
    steps: ["1 ms"]
    ways:
      - {name: inside the palm, set: {objects.0.position: [0, 0.05, 0.03]}, refused: inside right.palm}
  - name: repeats
    title: a hand, a ball and a box are dropped, 2000 steps
    oracle: the same run has the same bits, again, in eight threads at once, beside another world, restored and reset
    scene: dropped_hand.yaml
    set: {duration: "2 s"}
    steps: ["1 ms"]
    measures: [{measure: repeats, limit: 0}]
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE quick_step 20, set: {solver.method: quick_step}}
      - {name: ODE auto, set: {solver.method: auto}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
    quick: {set: {duration: "0.1 s"}}
  - name: second_hand
    title: two hands move side by side; the second is another one, elsewhere
    oracle: the first hand's bits do not depend on the second
    scene: stability/limp_hands.yaml
    steps: ["1 ms"]
    measures:
      - {measure: twin, limit: 0, body: right., with: {hands.1.wrist: {mount: free, position: [-5, 0, 3]}, hands.1.person: {stature: 1.5, mass: 45, sex: female}}}
    ways: *hard
  - name: round_trip
    title: random torques on a hand at rest in random poses
    oracle: Newton and Euler; the torques are found back from the motion
    scene: stability/free_hand.yaml
    steps: ["1 us"]
    measures: [{measure: round_trip, limit: 1e-10}]
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: articulated semi_implicit_euler, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
      - {name: articulated rk4, set: {solver.engine: articulated, solver.method: rk4}}
  - name: joint_reaction
    title: a hand hangs at rest from its wrist
    oracle: the wrist bears the hand's weight
    scene: stability/hanging_hand.yaml
    steps: ["1 ms", "5 ms"]
    measures: [{measure: reaction_error, joint: right.wrist, from: 19, limit: 1e-6}]
    ways: *hard
    plot: reaction_error
    quick: false
  - name: soak
    title: a hand and objects lie on the ground for a million steps
    oracle: memory, gaps and solver stay as they are
    scene: stability/falling_object.yaml
    set: {duration: "1000 s"}
    steps: ["1 ms"]
    measures:
      - {measure: memory_growth, limit: 0.01}
      - {measure: joint_gap, limit: "1 mm"}
      - {measure: lcp_failures, limit: 0}
    ways:
      - {name: ODE world_step guarded, set: {effects: [gravity, object_contact, ground_contact, friction, joint_stops, passive_tissue, step_guard]}}
    alone: true
    plot: joint_gap
    quick: false
  - name: limp_hands
    title: the shipped hands without control, 10 s
    oracle: energy does not rise; no acceleration beyond 1e6 rad/s^2; no failure of the solver
    scene: stability/limp_hands.yaml
    set: {duration: "10 s"}
    steps: ["1 ms"]
    vary:
      - of:
          - {name: anatomical straight, set: {title: straight}}
          - {name: anatomical half closed, set: {hands.0.pose: &half {index_mcp: [0.7, 0], index_pip: 0.8, middle_mcp: [0.7, 0], middle_pip: 0.8, ring_mcp: [0.7, 0], ring_pip: 0.8, little_mcp: [0.7, 0], little_pip: 0.8}, hands.1.pose: *half}}
          - {name: anatomical fist, set: {hands.0.pose: &fist {index_mcp: [1.5, 0], index_pip: 1.7, index_dip: 1.2, middle_mcp: [1.5, 0], middle_pip: 1.7, middle_dip: 1.2, ring_mcp: [1.5, 0], ring_pip: 1.7, ring_dip: 1.2, little_mcp: [1.5, 0], little_pip: 1.7, little_dip: 1.2}, hands.1.pose: *fist}}
    measures:
      - {measure: energy_rise, limit: 1e-3}
      - {measure: acceleration, limit: 1e6}
      - {measure: lcp_failures, limit: 0}
    ways: *hard
    picture: "0.1 s"
    quick: {set: {duration: "1 s"}}
  - name: prototype_hands
    title: the prototype's hands without control, 10 s
    oracle: energy does not rise; no acceleration beyond 1e6 rad/s^2; no failure of the solver
    scene: stability/limp_prototype.yaml
    steps: ["1 ms", "0.2 ms"]
    measures:
      - {measure: energy_rise, limit: 1e-3}
      - {measure: acceleration, limit: 1e6}
      - {measure: lcp_failures, limit: 0}
    ways: *hard
    quick: {set: {duration: "1 s"}}
  - name: persons
    title: hands of 1000 random persons fall limp, right and left
    oracle: they are mirror images
    scene: stability/limp_hands.yaml
    set: {duration: "1 s"}
    persons: {count: 1000, seed: 1}
    steps: ["1 ms"]
    measures:
      - {measure: mirror_error, limit: 1e-9}
      - {measure: joint_gap, limit: "0.1 mm"}
      - {measure: stop_overshoot, limit: 1e-6}
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
    quick: {persons: 20}
  - name: persons_dropped
    title: hands of 1000 random persons are dropped onto the ground
    oracle: joints hold together, nothing is thrown up
    scene: stability/dropped_hands.yaml
    persons: {count: 1000, seed: 2}
    steps: ["1 ms"]
    measures:
      - {measure: completes, limit: 0}
      - {measure: joint_gap, limit: "1 mm"}
      - {measure: top_speed, limit: "10 m/s"}
    ways:
      - {name: ODE world_step guarded, set: {effects: [gravity, ground_contact, friction, joint_stops, passive_tissue, step_guard]}}
    picture: "0.2 s"
    quick: {persons: 6}
  - name: persons_shaken
    title: hands of 1000 random persons close to a fist while they are shaken
    oracle: joints hold together
    scene: stability/closed_and_shaken.yaml
    persons: {count: 1000, seed: 3}
    steps: ["1 ms"]
    measures:
      - {measure: completes, limit: 0}
      - {measure: joint_gap, limit: "1 mm"}
    ways:
      - {name: ODE world_step guarded, set: {effects: [gravity, self_contact, friction, joint_stops, passive_tissue, actuation, wrist_motion, step_guard]}}
    picture: "0.6 s"
    quick: {persons: 6}
  - name: thumb_in_both_stops
    title: a thumb's root is driven into both stops at once
    oracle: stops and joint hold; what is pressed on is still
    scene: stability/thumb_cmc.yaml
    steps: ["10 ms", "5 ms", "1 ms"]
    vary: [{key: solver.erp, values: [0.2, 0.4, 0.6, 0.8, 0.9]}]
    measures:
      - {measure: stop_overshoot, limit: 1e-3}
      - {measure: stop_rest, limit: 1e-3}
      - {measure: joint_gap, limit: "0.1 mm"}
      - {measure: rms_speed, from: 0.5, limit: "10 um/s"}
    ways:
      - {name: ODE world_step, set: {solver.method: world_step}}
      - {name: ODE quick_step 50, set: {solver.method: quick_step, solver.iterations: 50}}
      - {name: ODE world_step with projection, set: {solver.projection: true}}
      - {name: articulated, set: {solver.engine: articulated, solver.method: semi_implicit_euler}}
  - name: stops_at_zero
    title: every joint of a finger starts on a stop at exactly 0
    oracle: energy does not rise; stops hold
    scene: stability/stops_at_zero.yaml
    steps: ["1 ms", "5 ms"]
    vary: [{key: solver.erp, values: [0.2, 0.8]}]
    measures:
      - {measure: energy_gain, limit: 0.01}
      - {measure: stop_overshoot, limit: 1e-4}
    ways: *hard
    picture: "0.3 s"
'''
open('../stability.yaml','w').write(text)
