from densarm.trajectory import Trajectory


def test_view_plays_the_run_and_tells_the_address(command, swing_up, monkeypatch):
    played = []

    def play(arm, scene, time, q, goal, *, on_url):
        played.append((arm.name, len(scene), time, q, goal))
        on_url("http://127.0.0.1:7000/static/")

    monkeypatch.setattr("densarm.visualization.view.play", play)
    done = command("view", swing_up.npz)
    assert done.status == 0
    assert "http://127.0.0.1:7000/static/" in done.out
    run = Trajectory.load(swing_up.npz)
    (name, n_obstacles, time, q, goal) = played[0]
    assert (name, n_obstacles) == ("two_link", 2)
    assert (time == run.time).all()
    assert (q == run.q).all()
    assert (goal == run.scenario.goal).all()
