"""The mathematics: from sensors to motion, numpy in and numpy out. Knows no bus and no wire.

Conventions, valid in every module (docs/conventions.md has the rest of the product's):

    units         SI and radians. Specific force in m/s^2, rates in rad/s, times in s.
    frames        i inertial, e Earth, n north-east-down at the device, b body. A vehicle's b is
                  forward-right-down; the cube's is parallel to its edges, +z_b up as it stands.
    names         a vector ends in its frame: f_b, v_n; omega_ib_b is the rate of b against i, in b.
    rotations     C_nb and q_nb turn a vector of b into n: f_n = C_nb f_b, equal letters touch.
                  Quaternions are w, x, y, z; roll, pitch, yaw are the z-y-x sequence.
    force         specific force, not acceleration: at rest an accelerometer reads one g upward.
    places        latitude and longitude in rad, height in m above the ellipsoid, up.
    covariances   of the error, estimate minus truth.
    equations     cited as (E-n): docs/equations.md and its sisters, one for each sub-package.
    bits          what runs live or is replayed gives the same bits on every processor: its sums,
                  roots and angles come from elementary, rotation and core, not from BLAS or libm.

Index, in the order in which the data pass:

    constants     one g, one WGS-84, one rate of the Earth, each with its source
    elementary    sine, products and sums with the same bits everywhere
    rotation      quaternions, matrices, rotation vectors, Euler angles: one of each
    earth         gravity, radii, places near by
    layouts       where accelerometers sit, and what that lets one know
    calibration   bias, scale and misalignment of an array from poses
    attitude      tilt filters of six-axis boards; which input of a converter is which axis
    rate          angular rate and acceleration from accelerometers alone
    navigation    strapdown, alignment, GNSS updates, constraints
    simulation    tables, drives and hands that move an array, with its errors
    core          the hot loops in C++20, bound by nanobind
    timing        period, numbers and holes of a row of time stamps
    plausible     are the numbers what their units say?
    doubts        is a setting wrong? what rates and gravity say of pulses, sizes, axes
    toml_file     files with a version, read strictly and written whole
    whole_file    what somebody named is written whole, and a device stays one
    one_at_a_time changes of a folder's files by several processes, one after the other
"""
