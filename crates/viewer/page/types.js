/**
 * @file The words that the server and the page have in common, as types for the editor and `tsc`.
 *
 * @typedef {[number, number, number]} Vec3
 *
 * @typedef {object} Shape What a parameter can hold.
 * @property {"table"|"value"|"list"|"map"} kind
 * @property {Field[]} [fields] of a table
 * @property {string} [expected] of a value: what it can be, in words
 * @property {"number"|"integer"|"bool"|"text"|"vec3"|"range"|"color"|"choice"} [type] of a value
 * @property {string[]} [choices] of a choice
 * @property {Shape} [of] of a list or a map
 * @property {Record<string, unknown>} [default] of a list: what a new entry holds
 *
 * @typedef {object} Field One parameter.
 * @property {string} name
 * @property {string} meaning
 * @property {string} [unit]
 * @property {unknown} [default]
 * @property {string} [example]
 * @property {Shape} shape
 *
 * @typedef {object} Property What particles carry.
 * @property {string} name
 * @property {string} type
 * @property {number} components
 * @property {number|null|(number|null)[]} min
 * @property {number|null|(number|null)[]} max
 *
 * @typedef {object} ParticleType
 * @property {string} name
 * @property {number} count
 * @property {string} color
 *
 * @typedef {object} System One set of particles.
 * @property {string} name
 * @property {string} source
 * @property {string} format
 * @property {number} frames
 * @property {number} particles
 * @property {boolean} live
 * @property {Property[]} properties
 * @property {ParticleType[]} types
 *
 * @typedef {object} ResolvedCamera
 * @property {"perspective"|"orthographic"} projection
 * @property {Vec3} position
 * @property {Vec3} target
 * @property {Vec3} up
 * @property {number} fov
 * @property {number} height
 *
 * @typedef {object} Resolved The scene as meant.
 * @property {ResolvedCamera} camera
 * @property {{min: Vec3, max: Vec3}|null} bounds
 * @property {number} radius
 * @property {number} frame
 * @property {number} frames
 * @property {boolean} playing
 *
 * @typedef {object} Frame A picture that came.
 * @property {number} serial
 * @property {boolean} exact
 * @property {boolean} coarse
 * @property {boolean} playing
 * @property {number} width
 * @property {number} height
 * @property {number} frame
 * @property {number} ms
 * @property {number} state
 * @property {string} hash
 * @property {Blob} blob
 *
 * @typedef {object} Picked A particle.
 * @property {number} system
 * @property {string} name
 * @property {number} index
 * @property {number|string} [id]
 * @property {number|string} [type]
 * @property {string} [element]
 * @property {Vec3} position
 * @property {number} radius
 * @property {number} depth
 * @property {Record<string, unknown>} properties
 *
 * @typedef {object} Section A cutting plane.
 * @property {string} name
 * @property {boolean} on
 * @property {Vec3} point
 * @property {Vec3} normal
 * @property {"centre"|"caps"|"open"} cut
 *
 * @typedef {Record<string, unknown>} Changes Values by path; `null` is the default.
 */
export {};
