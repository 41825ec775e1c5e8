// What does not change is asked for once.
import { expect, test } from "vitest";
import { Once } from "./once";

test("each is asked for once, a failure again", async () => {
  const once = new Once<string>();
  const asked: string[] = [];
  const ask = (key: string) => (): Promise<string> => {
    asked.push(key);
    return key === "b" && asked.length < 3 ? Promise.reject(new Error("no")) : Promise.resolve(key.toUpperCase());
  };
  expect(await once.get("a", ask("a"))).toBe("A");
  expect(await once.get("a", ask("a"))).toBe("A");
  await expect(once.get("b", ask("b"))).rejects.toThrow("no");
  asked.push("-");
  expect(await once.get("b", ask("b"))).toBe("B");
  expect(asked).toEqual(["a", "b", "-", "b"]);
});
