// What a person sets once: the unit of speeds, light or dark. The unit also stands in the address, since it is part
// of what a link shows.
import type { Speed } from "../lib/units";
import { route } from "./route.svelte";

export type Theme = "light" | "dark";
type Choice = Theme | "system";

const kept = (name: string): string | null => {
  try {
    return localStorage.getItem(name);
  } catch {
    return null;
  }
};

const keep = (name: string, value: string): void => {
  try {
    localStorage.setItem(name, value);
  } catch {
    // A browser that keeps nothing forgets it with the page.
  }
};

const isSpeed = (text: string | null | undefined): text is Speed => text === "m_per_day" || text === "m_per_a";
const isChoice = (text: string | null): text is Choice => text === "light" || text === "dark" || text === "system";

/** The unit of an address that names none. */
const USUAL: Speed = "m_per_day";

class Settings {
  #speed: Speed = $state(USUAL);
  #choice: Choice = $state("system");
  #systemIsDark = $state(false);

  constructor() {
    const [speed, choice] = [kept("melange.speed"), kept("melange.theme")];
    if (isSpeed(speed)) this.#speed = speed;
    if (isChoice(choice)) this.#choice = choice;
    const system = matchMedia("(prefers-color-scheme: dark)");
    this.#systemIsDark = system.matches;
    system.addEventListener("change", () => {
      this.#systemIsDark = system.matches;
      this.apply();
    });
    this.apply();
    // A unit that is remembered shows in the picture, so it stands in the address wherever one comes.
    $effect.root(() => {
      $effect(() => {
        if (this.#speed !== USUAL && route.query["speed"] === undefined) route.set({ speed: this.#speed });
      });
    });
  }

  /** Unit of speeds. */
  get speed(): Speed {
    const { speed } = route.query;
    return isSpeed(speed) ? speed : this.#speed;
  }

  set speed(speed: Speed) {
    this.#speed = speed;
    keep("melange.speed", speed);
    route.set({ speed });
  }

  get theme(): Theme {
    if (this.#choice !== "system") return this.#choice;
    return this.#systemIsDark ? "dark" : "light";
  }

  get choice(): Choice {
    return this.#choice;
  }

  set choice(choice: Choice) {
    this.#choice = choice;
    keep("melange.theme", choice);
    this.apply();
  }

  /** Tells the style which theme it is. */
  apply(): void {
    document.documentElement.dataset["theme"] = this.theme;
  }
}

export const settings = new Settings();
