// What the page knows of the service: who uses it, its dictionary, its ensembles, kept up to date.
import * as api from "../api";
import { busiest, idFilter, isBusy, replaced } from "../lib/busy";

/** Pause between two looks at the service, while runs are under way and while not; ms. */
const BUSY_MS = 500;
const IDLE_MS = 5000;

/** Ensembles under way that are looked at at the fast pace; the others wait for the whole list. */
const CLOSELY = 12;

/** Ensembles of a page of the list, and the most that are listed. */
const PAGE = 100;
export const MOST_LISTED = 1000;

/** Why a filter is refused, and at which character, counted from 1. */
export interface Refusal {
  filter: string;
  detail: string;
  character: number | undefined;
}

class Lab {
  me: api.Me | undefined = $state.raw();
  /** Whether the service wants a token before anything else. */
  isOutside = $state(false);
  dictionary: api.Dictionary | undefined = $state.raw();
  sweeps: api.Sweep[] = $state.raw([]);
  /** How many the filter lets through; the list has the newest of them. */
  total = $state(0);
  isLoaded = $state(false);
  trouble: string | undefined = $state();
  filter = $state("");
  /** How many are asked for. */
  limit = $state(PAGE);
  /** Tags of any ensemble seen so far. */
  tags: string[] = $state.raw([]);
  /** An ensemble that was just moved to the trash. */
  removed: api.Sweep | undefined = $state.raw();
  refusal: Refusal | undefined = $state.raw();

  #others = $state.raw(new Map<string, api.Sweep>());
  #timer: ReturnType<typeof setTimeout> | undefined;
  #wanted: string | undefined;
  /** When the whole list was asked for last, ms. */
  #listedAt = -Infinity;

  constructor() {
    // Who comes back to the page sees at once how things stand.
    document.addEventListener("visibilitychange", () => {
      if (!document.hidden && this.isLoaded) void this.look();
    });
  }

  /** A sweep of the list, or one that was asked for. */
  sweep(id: string): api.Sweep | undefined {
    return this.sweeps.find((s) => s.id === id) ?? this.#others.get(id);
  }

  /** Looks at everything now, and again after a pause that depends on whether runs are under way. */
  look(): Promise<void> {
    return this.#again(() => this.#look());
  }

  async #again(look: () => Promise<void>): Promise<void> {
    clearTimeout(this.#timer);
    await look();
    clearTimeout(this.#timer);
    // Nobody who is not logged in is asked for again and again.
    if (this.isOutside) return;
    const busy = this.#known().some(isBusy);
    const pause = document.hidden ? 4 * IDLE_MS : busy ? BUSY_MS : IDLE_MS;
    this.#timer = setTimeout(() => void this.#again(() => this.#next(busy)), pause);
  }

  #known(): api.Sweep[] {
    return [...this.sweeps, ...this.#others.values()];
  }

  /** What is under way is looked at closely, the whole list every few seconds. */
  #next(busy: boolean): Promise<void> {
    const isDue = performance.now() - this.#listedAt > IDLE_MS - BUSY_MS;
    return busy && !isDue ? this.#lookClosely() : this.#look();
  }

  /** Asks for what is under way and for nothing else. */
  async #lookClosely(): Promise<void> {
    const near = busiest(this.#known(), this.#wanted, CLOSELY).map((s) => s.id);
    try {
      const { items } = await api.sweeps(idFilter(near), near.length);
      // What is no longer there, or no longer under way, may change what is listed.
      if (items.length < near.length || items.some((s) => !isBusy(s))) {
        await this.#look();
        return;
      }
      this.sweeps = replaced(this.sweeps, items);
      this.#others = new Map(replaced([...this.#others.values()], items).map((s) => [s.id, s]));
      this.trouble = undefined;
    } catch {
      // The whole look tells what is wrong.
      await this.#look();
    }
  }

  /** Sees to it that a sweep is known that the list may not have. */
  want(id: string): void {
    if (this.#wanted === id) return;
    this.#wanted = id;
    // The first look sees to it by itself.
    if (this.isLoaded) void this.look();
  }

  async find(filter: string): Promise<void> {
    this.filter = filter;
    this.limit = PAGE;
    this.refusal = undefined;
    await this.look();
  }

  /** Lists more of them. */
  async more(): Promise<void> {
    this.limit = Math.min(MOST_LISTED, this.limit + PAGE);
    await this.look();
  }

  /** Moves an ensemble to the trash, from where it can come back. */
  async remove(sweep: api.Sweep): Promise<void> {
    await api.remove(sweep.id);
    this.#wanted = undefined;
    const others = new Map(this.#others);
    others.delete(sweep.id);
    this.#others = others;
    this.removed = sweep;
    await this.look();
  }

  /** Brings an ensemble back from the trash. */
  async recover(id: string): Promise<void> {
    await api.ask(id, "recover");
    if (this.removed?.id === id) this.removed = undefined;
    await this.look();
  }

  /** Asks again who uses it: people have changed. */
  async again(): Promise<void> {
    this.me = await api.me();
    await this.look();
  }

  /** Forgets everything, as for another person. */
  async leave(): Promise<void> {
    await api.logout();
    this.me = undefined;
    this.dictionary = undefined;
    this.sweeps = [];
    this.tags = [];
    this.removed = undefined;
    this.#others = new Map();
    this.isLoaded = false;
    await this.look();
  }

  async #look(): Promise<void> {
    this.#listedAt = performance.now();
    try {
      const asked = this.filter;
      // At once: through a tunnel every answer takes its time.
      const [me, dictionary, page] = await Promise.all([
        this.me ?? api.me(),
        this.dictionary ?? api.dictionary(),
        api.sweeps(asked, this.limit),
      ]);
      [this.me, this.dictionary] = [me, dictionary];
      this.isOutside = false;
      // An answer to what is no longer asked.
      if (asked !== this.filter) return;
      // First what is looked at: it must not vanish in between when the list no longer has it.
      await this.#lookAtWanted(page.items);
      if (asked !== this.filter) return;
      this.sweeps = page.items;
      this.total = page.total;
      const tags = new Set([...this.tags, ...[...page.items, ...this.#others.values()].flatMap((s) => s.tags)]);
      if (tags.size > this.tags.length) this.tags = [...tags].sort();
      this.isLoaded = true;
      this.trouble = undefined;
    } catch (error) {
      if (error instanceof api.Problem && error.status === 401) {
        this.me = undefined;
        this.isOutside = true;
        this.trouble = undefined;
      } else if (error instanceof api.Problem && error.field === "filter") {
        const { message: detail, character } = error;
        this.refusal = { filter: this.filter, detail, character };
        // It is asked without the filter that cannot be read, until another one comes.
        this.filter = "";
      } else {
        this.trouble = api.sentence(error);
      }
    }
  }

  /** What is looked at stays known, also when the filter no longer lists it. */
  async #lookAtWanted(listed: api.Sweep[]): Promise<void> {
    const id = this.#wanted;
    if (id === undefined || listed.some((s) => s.id === id)) return;
    try {
      const sweep = await api.sweep(id);
      this.#others = new Map(this.#others).set(id, sweep);
    } catch (error) {
      if (!(error instanceof api.Problem && error.status === 404)) throw error;
      const others = new Map(this.#others);
      others.delete(id);
      this.#others = others;
    }
    // Who went on meanwhile looks at another one.
    if (this.#wanted !== id) await this.#lookAtWanted(listed);
  }
}

export const lab = new Lab();
