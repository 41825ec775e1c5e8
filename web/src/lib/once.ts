// Answers that never change, such as those about runs that have ended: each is asked for once.

export class Once<T> {
  #kept = new Map<string, Promise<T>>();

  /** The answer, asked for where it is not there yet; one that failed is asked for again. */
  get(key: string, ask: () => Promise<T>): Promise<T> {
    const known = this.#kept.get(key);
    if (known) return known;
    const asked = ask();
    this.#kept.set(key, asked);
    asked.catch(() => this.#kept.delete(key));
    return asked;
  }
}
