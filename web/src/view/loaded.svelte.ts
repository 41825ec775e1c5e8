// Something the service is asked for, again whenever what is wanted changes: one request at a time, the last wish
// wins, and what was there stays in sight until its successor has come.
import { sentence } from "../api/client";

/** Within an effect: it runs again when these change, also where it does not need them. */
export const dependsOn = (...values: unknown[]): number => values.length;

export class Loaded<T> {
  /** What was loaded last. */
  value: T | undefined = $state.raw();
  /** Whether something else is on its way. */
  loading = $state(false);
  /** Why the last wish failed. */
  problem: string | undefined = $state();
  /** The same as it was thrown. */
  error: unknown = $state.raw();

  #wanted: (() => Promise<T>) | undefined;
  #last: (() => Promise<T>) | undefined;
  #working = false;
  /** Counts wishes; an answer counts only as long as none came after the one it is to. */
  #generation = 0;

  /** Asks, now or after the request that is under way. */
  ask(wanted: () => Promise<T>): void {
    this.#generation += 1;
    this.#wanted = wanted;
    this.#last = wanted;
    this.loading = true;
    if (this.#working) return;
    this.#working = true;
    void this.#work();
  }

  /** Asks once more for what was asked for last. */
  again(): void {
    if (this.#last) this.ask(this.#last);
  }

  /** Forgets what is there, what was asked for, and what is still to come. */
  clear(): void {
    this.#generation += 1;
    this.value = undefined;
    this.problem = undefined;
    this.error = undefined;
    this.loading = false;
    this.#wanted = undefined;
    this.#last = undefined;
  }

  async #work(): Promise<void> {
    while (this.#wanted) {
      const [next, generation] = [this.#wanted, this.#generation];
      this.#wanted = undefined;
      try {
        const value = await next();
        if (generation !== this.#generation) continue;
        this.value = value;
        this.problem = undefined;
        this.error = undefined;
      } catch (error) {
        if (generation !== this.#generation) continue;
        this.problem = sentence(error);
        this.error = error;
      }
    }
    this.#working = false;
    this.loading = false;
  }
}
