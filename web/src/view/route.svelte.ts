// What the page shows stands in its address, after the #, so that a link shows a colleague the same picture.
import { type Place, along, readPlace, writePlace } from "../lib/place";

class Route {
  #place: Place = $state.raw(readPlace(location.hash));

  constructor() {
    addEventListener("hashchange", () => {
      this.#place = readPlace(location.hash);
    });
  }

  get path(): string[] {
    return this.#place.path;
  }

  get query(): Record<string, string> {
    return this.#place.query;
  }

  /** Goes to another place; the way back leads here. */
  go(path: string[], query: Record<string, string> = {}): void {
    location.hash = writePlace({ path, query: { ...this.#kept(), ...query } });
  }

  /** The same place with something else chosen; the way back does not count it. */
  set(change: Record<string, string | undefined>): void {
    const query = { ...this.#place.query };
    for (const [name, value] of Object.entries(change)) {
      if (value === undefined) Reflect.deleteProperty(query, name);
      else query[name] = value;
    }
    this.replace(this.#place.path, query);
  }

  /** Another place instead of this one. */
  replace(path: string[], query: Record<string, string> = this.#kept()): void {
    this.#place = { path, query };
    history.replaceState(null, "", writePlace(this.#place));
  }

  /** Address of a place, for links. */
  href(path: string[], query: Record<string, string> = {}): string {
    return writePlace({ path, query: { ...this.#kept(), ...query } });
  }

  /** What goes along from place to place: the units, and what is listed. */
  #kept(): Record<string, string> {
    return along(this.#place.query);
  }
}

export const route = new Route();
