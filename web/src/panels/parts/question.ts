// A question that is asked before something is lost.

export interface Question {
  title: string;
  text: string;
  /** What the button says. */
  verb: string;
  isDanger?: boolean;
  act: () => Promise<unknown>;
  /** Once it is done and the question has gone: where the keyboard goes on. */
  after?: () => void;
}
