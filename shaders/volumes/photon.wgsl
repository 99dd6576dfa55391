// What stands in the two tables that count photons: `tallies` for all so far, `score` for one batch. VOXELS entries come
// first, then four words for each voxel: fluence and deposited weight, each an integer of two words, low before high. In
// `tallies` the sum of squares of each voxel's fluence follows. In `score` there are BANKS sets of voxels, to be added up:
// where voxels are few, threads would wait for each other at the same words.

/// In `tallies`: photons, batches, and photons when the last batch is done.
const PHOTONS = 0;
const BATCHES = 1;
const LAST = 2;

/// In `score`: photons taken by threads and ended, all photons of the batch, and how many came before it.
const ISSUED = 0;
const ENDED = 1;
const COUNT = 2;
const FIRST = 3;

/// How often a sum left its two words.
const OVERFLOWS = 4;

/// Weight that was given up, and weight that left through each face (−x, +x, −y, +y, −z, +z), of two words each.
const ALIVE = 6;
const FACES = 8;
const VOXELS = 20;
