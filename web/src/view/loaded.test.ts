// What is loaded: the last wish wins, also over answers that are still under way.
import { expect, test } from "vitest";
import { Loaded } from "./loaded.svelte";

/** A wish whose answer comes when the test wants. */
function wish<T>(): { ask: () => Promise<T>; give: (value: T) => Promise<void>; refuse: (why: string) => Promise<void> } {
  let answer: (value: T) => void = () => undefined;
  let fail: (why: Error) => void = () => undefined;
  const promise = new Promise<T>((resolve, reject) => {
    [answer, fail] = [resolve, reject];
  });
  const settled = (): Promise<void> => new Promise((done) => setTimeout(done, 0));
  return {
    ask: () => promise,
    give: (value) => {
      answer(value);
      return settled();
    },
    refuse: (why) => {
      fail(new Error(why));
      return settled();
    },
  };
}

test("an answer comes, and stays in sight while the next is on its way", async () => {
  const loaded = new Loaded<string>();
  const [first, second] = [wish<string>(), wish<string>()];
  loaded.ask(first.ask);
  expect(loaded.loading).toBe(true);
  await first.give("first");
  expect([loaded.value, loaded.loading]).toEqual(["first", false]);
  loaded.ask(second.ask);
  expect([loaded.value, loaded.loading]).toEqual(["first", true]);
  await second.refuse("no");
  expect([loaded.value, loaded.problem, loaded.loading]).toEqual(["first", "no", false]);
});

test("an older answer is not shown where a newer wish waits, nor is its failure", async () => {
  const loaded = new Loaded<string>();
  const [first, second, third] = [wish<string>(), wish<string>(), wish<string>()];
  loaded.ask(first.ask);
  loaded.ask(second.ask);
  await first.give("first");
  expect([loaded.value, loaded.loading]).toEqual([undefined, true]);
  loaded.ask(third.ask);
  await second.refuse("no");
  expect(loaded.problem).toBeUndefined();
  await third.give("third");
  expect([loaded.value, loaded.loading]).toEqual(["third", false]);
});

test("what is forgotten does not come back", async () => {
  const loaded = new Loaded<string>();
  const [first, second] = [wish<string>(), wish<string>()];
  loaded.ask(first.ask);
  loaded.clear();
  expect(loaded.loading).toBe(false);
  await first.give("first");
  expect([loaded.value, loaded.loading]).toEqual([undefined, false]);
  loaded.again();
  expect(loaded.loading).toBe(false);
  loaded.ask(second.ask);
  await second.give("second");
  expect(loaded.value).toBe("second");
});
