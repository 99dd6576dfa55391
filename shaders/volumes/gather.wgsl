/// In `score`: pixels taken by threads, done, and those that may be taken.
const ISSUED = 0;
const ENDED = 1;
const LIMIT = 2;
