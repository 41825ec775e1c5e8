// A number that changes often, followed at a pace that spares the service: at most once a second, and less often where
// an answer takes long.

/** Shortest pause between two changes, ms. */
const PAUSE_MS = 1000;
/** Share of the time that answers may take. */
const SHARE = 0.1;

export class Paced {
  #value: number | undefined = $state();
  #since = -Infinity;
  #pause = PAUSE_MS;
  #timer: ReturnType<typeof setTimeout> | undefined;

  /** The number as it was last followed; undefined before. */
  get value(): number | undefined {
    return this.#value;
  }

  /** Follows a number, now or after the pause; at once if it is its last. */
  follow(value: number, isLast: boolean): void {
    clearTimeout(this.#timer);
    const wait = this.#since + this.#pause - performance.now();
    if (isLast || wait <= 0) this.#take(value);
    else this.#timer = setTimeout(() => this.#take(value), wait);
  }

  /** How long an answer took, ms. */
  took(ms: number): void {
    this.#pause = Math.max(PAUSE_MS, ms / SHARE);
  }

  stop(): void {
    clearTimeout(this.#timer);
  }

  #take(value: number): void {
    this.#since = performance.now();
    this.#value = value;
  }
}
